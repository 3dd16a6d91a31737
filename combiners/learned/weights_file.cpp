// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/weights_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <half.h>
#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

static_assert(std::endian::native == std::endian::little);  // as the numbers of these files are

std::vector<uint8_t> readWeightsFile(const std::string& path, uint64_t most) {
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(path, error);
  if (error) throw Error(ExitCode::BadInput, fmt::format("{}: {}", path, error.message()));
  if (bytes > most)
    throw Error(ExitCode::BadInput, fmt::format("{}: {} bytes, too large for weights of a network", path, bytes));
  std::vector<uint8_t> file(bytes);
  std::ifstream in(path, std::ios::binary);
  if (!in.read(reinterpret_cast<char*>(file.data()), static_cast<std::streamsize>(bytes)))
    throw Error(ExitCode::BadInput, path + ": cannot be read: look at its permissions");
  return file;
}

std::vector<float> fromHalves(std::span<const uint8_t> bytes) {
  std::vector<float> values(bytes.size() / sizeof(Imath::half));
  for (size_t i = 0; i < values.size(); ++i) {
    Imath::half half;
    std::memcpy(&half, &bytes[i * sizeof half], sizeof half);
    values[i] = half;
  }
  return values;
}

bool areFinite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

}  // namespace braid
