// SPDX-License-Identifier: Apache-2.0
// AVIF images against the pixels that went into them, without loss.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "renderer/scene/data/textures/texture.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/textures/avif_writer.h"

namespace braid::test_texture_avif {

namespace {

using test::avifOf;
using test::AvifOptions;
using Bytes = std::vector<uint8_t>;

Bytes pattern(size_t pixels) {
  Bytes rgba;
  for (size_t i = 0; i < 4 * pixels; ++i) rgba.push_back(static_cast<uint8_t>(i * 37 + i / 7));
  return rgba;
}

Bytes withoutAlpha(const Bytes& rgba) {
  Bytes rgb;
  for (size_t i = 0; i < rgba.size(); ++i)
    if (i % 4 != 3) rgb.push_back(rgba[i]);
  return rgb;
}

std::shared_ptr<const Image> decoded(const Bytes& file) { return decodeImage(file.data(), file.size(), "x"); }

std::string reasonOf(const Bytes& file) {
  try {
    decoded(file);
  } catch (const Error& error) {
    CHECK(error.code() == ExitCode::BadInput);
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
  return {};
}

// Where a box of this kind has its contents.
size_t contentsOf(const Bytes& file, const char* kind) {
  const auto at = std::search(file.begin(), file.end(), kind, kind + 4);
  REQUIRE(at != file.end());
  return static_cast<size_t>(at - file.begin()) + 4;
}

void putSize(Bytes& file, size_t at, uint32_t value) {
  for (size_t k = 0; k < 4; ++k) file[at + k] = static_cast<uint8_t>(value >> (24 - 8 * k));
}

}  // namespace

TEST_CASE("texture: AVIF without loss has the pixels of the picture, with and without alpha") {
  const Bytes rgba = pattern(7 * 5);
  const auto plain = decoded(avifOf(rgba, {.width = 7, .height = 5}));
  CHECK(plain->width == 7);
  CHECK(plain->height == 5);
  CHECK(plain->channels == 3);
  CHECK(plain->bytes == withoutAlpha(rgba));
  const auto veiled = decoded(avifOf(rgba, {.width = 7, .height = 5, .alpha = true}));
  CHECK(veiled->channels == 4);
  CHECK(veiled->bytes == rgba);
}

TEST_CASE("texture: an AVIF file by its path is what it is in memory") {
  const test::Folder folder;
  const Bytes bytes = avifOf(pattern(7 * 5), {.width = 7, .height = 5, .alpha = true});
  const std::string path = folder.write("picture.avif", std::string(bytes.begin(), bytes.end()));
  CHECK(readImageFile(path)->bytes == decoded(bytes)->bytes);
}

TEST_CASE("texture: AVIF whose colours are multiplied by alpha gives them undivided") {
  const auto image = decoded(avifOf<uint8_t>({64, 32, 16, 128}, {.alpha = true, .premultiplied = true}));
  REQUIRE(image->channels == 4);
  CHECK(std::abs(image->bytes[0] - 127) <= 1);
  CHECK(std::abs(image->bytes[1] - 64) <= 1);
  CHECK(std::abs(image->bytes[2] - 32) <= 1);
  CHECK(image->bytes[3] == 128);
}

TEST_CASE("texture: AVIF of 10 and 12 bits keeps its precision") {
  for (const uint32_t depth : {10u, 12u}) {
    const auto most = static_cast<float>((1u << depth) - 1);
    const std::vector<uint16_t> rgba{0, 1, static_cast<uint16_t>(most), static_cast<uint16_t>(most), 301, 302, 303, 7};
    const auto image = decoded(avifOf(rgba, {.width = 2, .depth = depth, .alpha = true}));
    REQUIRE(image->floats.size() == 8);
    CHECK(image->integerFloats);
    for (size_t i = 0; i < 8; ++i) CHECK(image->floats[i] == doctest::Approx(rgba[i] / most).epsilon(2e-5));
  }
}

TEST_CASE("texture: AVIF is turned and mirrored as its container says") {
  // a b c
  // d e f, letters as the red of a pixel
  Bytes rgba;
  for (uint8_t letter = 1; letter <= 6; ++letter) rgba.insert(rgba.end(), {letter, 0, 0, 255});
  const auto shown = [&](uint8_t turns, int mirror) {
    const auto image = decoded(avifOf(rgba, {.width = 3, .height = 2, .quarterTurns = turns, .mirror = mirror}));
    std::string rows;
    for (int y = 0; y < image->height; ++y, rows += '/')
      for (int x = 0; x < image->width; ++x)
        rows += static_cast<char>('a' - 1 + image->bytes[static_cast<size_t>(3 * (y * image->width + x))]);
    return rows;
  };
  CHECK(shown(0, -1) == "abc/def/");
  CHECK(shown(1, -1) == "cf/be/ad/");
  CHECK(shown(2, -1) == "fed/cba/");
  CHECK(shown(3, -1) == "da/eb/fc/");
  CHECK(shown(0, 0) == "def/abc/");
  CHECK(shown(0, 1) == "cba/fed/");
  CHECK(shown(1, 0) == "ad/be/cf/");
  CHECK(shown(1, 1) == "fc/eb/da/");
}

TEST_CASE("texture: a broken AVIF file is an error of one line") {
  const Bytes whole = avifOf(pattern(16 * 16), {.width = 16, .height = 16, .alpha = true});
  REQUIRE(reasonOf(whole).empty());
  for (size_t size = 0; size < whole.size(); size += 11)
    CHECK(reasonOf(Bytes(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(size))) != "");
  CHECK(reasonOf({0, 0, 0, 16, 'f', 't', 'y', 'p', 'm', 'p', '4', '2', 0, 0, 0, 0}) != "");
}

TEST_CASE("texture: what an AVIF file claims is checked before memory is taken for it") {
  Bytes file = avifOf(pattern(16 * 16), {.width = 16, .height = 16});
  const size_t size = contentsOf(file, "ispe") + 4;
  const auto claims = [&](uint32_t width, uint32_t height) {
    Bytes changed = file;
    putSize(changed, size, width);
    putSize(changed, size + 4, height);
    return reasonOf(changed);
  };
  CHECK(claims(16000, 16000).find("damaged") != std::string::npos);
  CHECK(claims(100000, 100000) != "");
  CHECK(claims(0, 16) != "");
  // A flat picture of many texels in a few bytes is one.
  const Bytes flat(size_t{2048} * 2048 * 4, 128);
  CHECK(reasonOf(avifOf(flat, {.width = 2048, .height = 2048})) == "");
  // The payload is larger than its container says.
  CHECK(claims(8, 8) != "");
}

}  // namespace braid::test_texture_avif
