// SPDX-License-Identifier: Apache-2.0
// Writes PNG files for tests: 8 bits a channel.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <zlib.h>

namespace braid::test {

// `pixels`: RGB or RGBA, interleaved, rows from the top.
inline std::vector<uint8_t> pngOf(uint32_t width, uint32_t height, const std::vector<uint8_t>& pixels) {
  const size_t rowBytes = pixels.size() / height;
  std::vector<uint8_t> rows;
  for (size_t y = 0; y < height; ++y) {
    rows.push_back(0);  // no filter
    rows.insert(rows.end(), pixels.begin() + static_cast<std::ptrdiff_t>(y * rowBytes),
                pixels.begin() + static_cast<std::ptrdiff_t>((y + 1) * rowBytes));
  }
  std::vector<uint8_t> packed(compressBound(rows.size()));
  uLongf size = packed.size();
  REQUIRE(compress(packed.data(), &size, rows.data(), rows.size()) == Z_OK);
  packed.resize(size);
  std::vector<uint8_t> png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  const auto put = [](std::vector<uint8_t>& to, uint32_t v) {
    for (const int shift : {24, 16, 8, 0}) to.push_back(static_cast<uint8_t>(v >> shift));
  };
  const auto chunk = [&](const std::string& kind, const std::vector<uint8_t>& data) {
    std::vector<uint8_t> body(kind.begin(), kind.end());
    body.insert(body.end(), data.begin(), data.end());
    put(png, static_cast<uint32_t>(data.size()));
    png.insert(png.end(), body.begin(), body.end());
    put(png, static_cast<uint32_t>(crc32(0, body.data(), static_cast<uInt>(body.size()))));
  };
  std::vector<uint8_t> header;
  put(header, width);
  put(header, height);
  header.insert(header.end(), {8, static_cast<uint8_t>(rowBytes / width == 4 ? 6 : 2), 0, 0, 0});
  chunk("IHDR", header);
  chunk("IDAT", packed);
  chunk("IEND", {});
  return png;
}

}  // namespace braid::test
