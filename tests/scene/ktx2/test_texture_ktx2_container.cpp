// SPDX-License-Identifier: Apache-2.0
// KTX2 files: what the header says of formats, levels, compression, channels and orientation, and files that are
// broken.
#include <bit>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <zlib.h>
#include <zstd.h>

#include "renderer/scene/data/ktx2/ktx2.h"
#include "renderer/scene/data/textures/ktx2_image.h"
#include "tests/support/textures/ktx2_writer.h"

namespace braid::test_texture_ktx2_container {

using namespace braid::ktx2;
using namespace braid::test;

namespace {

enum : uint32_t { kR8 = 9, kRg8 = 16, kRgb8 = 23, kBgr8 = 30, kRgba8 = 37, kRgba8Srgb = 43, kBgra8Srgb = 50 };

Ktx2Writer plain(uint32_t format, uint32_t width, uint32_t height, const ByteVector& texels) {
  Ktx2Writer file;
  file.vkFormat = format;
  file.width = width;
  file.height = height;
  file.levels[0] = texels;
  return file;
}

// 3 x 2 texels with the channels 10 i + c.
ByteVector sixTexels(int channels) {
  ByteVector out;
  for (int i = 0; i < 6; ++i)
    for (int c = 0; c < channels; ++c) out.push_back(static_cast<uint8_t>(10 * i + c));
  return out;
}

std::string messageOf(const ByteVector& file) {
  try {
    decode(file);
    return "";
  } catch (const Error& error) {
    CHECK(error.code() == ExitCode::BadInput);
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
}

ByteVector zstandard(const ByteVector& bytes) {
  ByteVector out(ZSTD_compressBound(bytes.size()));
  out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
  return out;
}

ByteVector deflated(const ByteVector& bytes) {
  ByteVector out(compressBound(bytes.size()));
  uLongf size = out.size();
  REQUIRE(compress(out.data(), &size, bytes.data(), bytes.size()) == Z_OK);
  out.resize(size);
  return out;
}

void put(ByteVector& file, size_t at, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) file[at + static_cast<size_t>(i)] = static_cast<uint8_t>(value >> (8 * i));
}

}  // namespace

TEST_CASE("KTX2: bytes of one to four channels; what is missing is black and opaque") {
  Picture p = decode(plain(kRgba8, 3, 2, sixTexels(4)).file());
  CHECK(p.width == 3);
  CHECK(p.height == 2);
  CHECK(p.channels == 4);
  CHECK(p.bytes == sixTexels(4));
  CHECK_FALSE(p.srgb);
  p = decode(plain(kRgb8, 3, 2, sixTexels(3)).file());
  CHECK(p.channels == 3);
  CHECK(p.bytes == sixTexels(3));
  CHECK_FALSE(p.isRedGreen);
  p = decode(plain(kRg8, 3, 2, sixTexels(2)).file());
  CHECK(p.bytes == ByteVector{0, 1, 0, 10, 11, 0, 20, 21, 0, 30, 31, 0, 40, 41, 0, 50, 51, 0});
  CHECK(p.isRedGreen);
  p = decode(plain(kR8, 3, 2, sixTexels(1)).file());
  CHECK(p.bytes == ByteVector{0, 0, 0, 10, 0, 0, 20, 0, 0, 30, 0, 0, 40, 0, 0, 50, 0, 0});
  CHECK_FALSE(p.isRedGreen);
  p = decode(plain(kBgra8Srgb, 1, 1, {1, 2, 3, 4}).file());
  CHECK(p.bytes == ByteVector{3, 2, 1, 4});
  CHECK(p.srgb);
  CHECK(decode(plain(kBgr8, 1, 1, {1, 2, 3}).file()).bytes == ByteVector{3, 2, 1});
}

TEST_CASE("KTX2: integers of 16 bits, halves and floats") {
  Picture p = decode(plain(91, 1, 1, {0xFF, 0xFF, 0x00, 0x00, 0x34, 0x12, 0x00, 0x80}).file());
  REQUIRE(p.floats.size() == 4);
  CHECK(p.isInteger);
  CHECK(p.floats == std::vector<float>{1, 0, 0x1234 / 65535.0f, 0x8000 / 65535.0f});
  // Halves: 1, the smallest, the largest, -2, infinity, and a tenth as 0x2E66.
  ByteVector halves;
  for (const uint64_t half : {0x3C00, 0x0001, 0x7BFF, 0xC000, 0x7C00, 0x2E66}) appendNumber(halves, half, 2);
  p = decode(plain(90, 2, 1, halves).file());
  REQUIRE(p.floats.size() == 6);
  CHECK_FALSE(p.isInteger);
  CHECK(p.floats[0] == 1);
  CHECK(p.floats[1] == 0x1p-24f);
  CHECK(p.floats[2] == 65504);
  CHECK(p.floats[3] == -2);
  CHECK(std::isinf(p.floats[4]));
  CHECK(p.floats[5] == doctest::Approx(0.1).epsilon(1e-3));
  ByteVector floats;
  for (const float value : {0.25f, 1e20f, -3.0f, NAN}) appendNumber(floats, std::bit_cast<uint32_t>(value), 4);
  const ByteVector file = plain(109, 1, 1, floats).file();
  const auto image = decodeKtx2(file.data(), file.size(), "x");
  CHECK(image->floats == std::vector<float>{0.25f, 1e18f, 0, 0});
  CHECK(image->limited == 3);
}

TEST_CASE("KTX2: of all levels, layers and faces the largest and first is read") {
  Ktx2Writer file = plain(kRgba8, 4, 2, ByteVector(32, 7));
  file.levels.push_back(ByteVector(8, 8));
  file.levels.push_back(ByteVector(4, 9));
  CHECK(decode(file.file()).bytes == ByteVector(32, 7));
  CHECK_FALSE(decode(file.file()).isSeveral);
  Ktx2Writer layers = plain(kRgba8, 1, 1, {1, 2, 3, 4, 5, 6, 7, 8});
  layers.layers = 2;
  CHECK(decode(layers.file()).bytes == ByteVector{1, 2, 3, 4});
  CHECK(decode(layers.file()).isSeveral);
  Ktx2Writer cube = plain(kRgba8, 1, 1, ByteVector(24, 5));
  cube.faces = 6;
  CHECK(decode(cube.file()).isSeveral);
  Ktx2Writer frames = plain(kRgba8, 1, 1, {1, 2, 3, 4});
  frames.keys["KTXanimData"] = std::string(12, '\0');
  CHECK(decode(frames.file()).isSeveral);
  Ktx2Writer volume = plain(kRgba8, 1, 1, ByteVector(8));
  volume.depth = 2;
  CHECK(messageOf(volume.file()) ==
        "is a KTX2 image of a volume, which is not supported; save it as UASTC, ETC1S or PNG");
  Ktx2Writer row = plain(kRgba8, 2, 0, ByteVector(8, 3));
  CHECK(decode(row.file()).height == 1);
}

TEST_CASE("KTX2: levels packed by Zstandard and ZLIB") {
  ByteVector texels;
  for (int i = 0; i < 64 * 64 * 4; ++i) texels.push_back(static_cast<uint8_t>(i * i >> 4));
  Ktx2Writer file = plain(kRgba8, 64, 64, texels);
  file.scheme = 2;
  file.levels[0] = zstandard(texels);
  CHECK(decode(file.file()).bytes == texels);
  const Ktx2Writer whole = file;
  file.scheme = 3;
  file.levels[0] = deflated(texels);
  CHECK(decode(file.file()).bytes == texels);
  for (Ktx2Writer packed : {whole, file}) {
    const ByteVector level = packed.levels[0];
    for (size_t bytes = 0; bytes + 20 < level.size(); bytes += 1 + bytes / 3) {
      packed.levels[0].assign(level.begin(), level.begin() + static_cast<ptrdiff_t>(bytes));
      CHECK(messageOf(packed.file()).find("is a broken KTX2 image") == 0);
    }
    packed.levels[0] = level;
    packed.height = 65;  // one row more than there is
    CHECK(messageOf(packed.file()).find("too short") != std::string::npos);
    packed.height = 60;  // the rest is left
    CHECK(decode(packed.file()).height == 60);
  }
}

TEST_CASE("KTX2: UASTC under Zstandard, and its channels") {
  BitWriter block;  // a solid block of (1, 2, 3, 4)
  block.put(0x17, 5);
  block.put(0x04030201, 32);
  ByteVector bytes = block.bytes();
  bytes.resize(16);
  Ktx2Writer file;
  file.model = 166;
  file.levels[0] = bytes;
  const auto first = [&](uint8_t channel) {
    file.channels = {channel};
    const Picture p = decode(file.file());
    return ByteVector(p.bytes.begin(), p.bytes.begin() + p.channels);
  };
  CHECK(first(0) == ByteVector{1, 2, 3});
  CHECK(first(3) == ByteVector{1, 2, 3, 4});
  CHECK(first(4) == ByteVector{1});
  CHECK(first(5) == ByteVector{1, 4, 0});  // red in all colours, green in alpha
  CHECK(decode(file.file()).isRedGreen);
  CHECK(first(6) == ByteVector{1, 2, 0});
  CHECK(decode(file.file()).isRedGreen);
  file.channels = {3};
  file.scheme = 2;
  file.levels[0] = zstandard(bytes);
  CHECK(first(3) == ByteVector{1, 2, 3, 4});
}

TEST_CASE("KTX2: the transfer function and premultiplied alpha") {
  Ktx2Writer file = plain(kRgba8Srgb, 2, 1, {10, 20, 30, 51, 9, 9, 9, 0});
  CHECK(decode(file.file()).srgb);
  file.flags = 1;
  // 10 x 255 / 51 = 50, 20 -> 100, 30 -> 150; where nothing is left to see, colours stay.
  CHECK(decode(file.file()).bytes == ByteVector{50, 100, 150, 51, 9, 9, 9, 0});
  Ktx2Writer uastc;
  uastc.model = 166;
  uastc.transfer = 2;
  uastc.levels[0] = ByteVector(16, 0x17);
  CHECK(decode(uastc.file()).srgb);
  Ktx2Writer opaque = plain(kRgb8, 1, 1, {10, 20, 30});
  opaque.flags = 1;
  CHECK(decode(opaque.file()).bytes == ByteVector{10, 20, 30});
}

TEST_CASE("KTX2: swizzles") {
  const auto swizzled = [](const std::string& swizzle) {
    Ktx2Writer file = plain(kRgba8, 1, 1, {1, 2, 3, 4});
    file.keys["KTXswizzle"] = swizzle;
    return decode(file.file()).bytes;
  };
  CHECK(swizzled("rgba") == ByteVector{1, 2, 3, 4});
  CHECK(swizzled("bgra") == ByteVector{3, 2, 1, 4});
  CHECK(swizzled("rrr1") == ByteVector{1});
  CHECK(swizzled("rrrg") == ByteVector{1, 2});
  CHECK(swizzled("rg01") == ByteVector{1, 2, 0});
  CHECK(swizzled("000r") == ByteVector{0, 1});
  CHECK(swizzled("10ab") == ByteVector{255, 0, 4, 3});
  CHECK(swizzled("rgbx") == ByteVector{1, 2, 3, 4});
  CHECK(swizzled("rg") == ByteVector{1, 2, 3, 4});
  CHECK(swizzled(std::string("rgb1\0", 5)) == ByteVector{1, 2, 3});
}

TEST_CASE("KTX2: orientations are turned upright") {
  const auto turned = [](const std::string& orientation) {
    Ktx2Writer file = plain(kR8, 2, 2, {1, 2, 3, 4});
    file.keys["KTXorientation"] = orientation;
    file.keys["KTXswizzle"] = "rrr1";
    file.keys["KTXwriter"] = "a test";
    return decode(file.file()).bytes;
  };
  CHECK(turned("rd") == ByteVector{1, 2, 3, 4});
  CHECK(turned("ru") == ByteVector{3, 4, 1, 2});
  CHECK(turned("ld") == ByteVector{2, 1, 4, 3});
  CHECK(turned("lu") == ByteVector{4, 3, 2, 1});
  CHECK(turned("xy") == ByteVector{1, 2, 3, 4});
  CHECK(turned("") == ByteVector{1, 2, 3, 4});
}

TEST_CASE("KTX2: what is not read is refused by name") {
  Ktx2Writer file;
  file.levels[0] = ByteVector(64);
  file.vkFormat = 157;  // ASTC
  CHECK(messageOf(file.file()).find("graphics cards (vkFormat 157)") != std::string::npos);
  file.vkFormat = 0;
  file.model = 167;
  CHECK(messageOf(file.file()).find("of colour model 167") != std::string::npos);
  file.model = 163;  // without BasisLZ
  CHECK(messageOf(file.file()).find("of colour model 163") != std::string::npos);
  file.model = 166;
  file.scheme = 1;
  CHECK(messageOf(file.file()).find("BasisLZ around other blocks") != std::string::npos);
  file.scheme = 4;
  CHECK(messageOf(file.file()).find("supercompression scheme 4") != std::string::npos);
}

TEST_CASE("KTX2: files that are cut are refused at every byte") {
  Ktx2Writer writer = plain(kRgba8, 3, 2, sixTexels(4));
  writer.keys["KTXorientation"] = "rd";
  const ByteVector file = writer.file();
  REQUIRE(messageOf(file).empty());
  for (size_t bytes = 0; bytes < file.size(); ++bytes)
    CHECK(messageOf({file.begin(), file.begin() + static_cast<ptrdiff_t>(bytes)}) != "");
}

TEST_CASE("KTX2: wrong offsets, sizes and lengths") {
  const ByteVector file = plain(kRgba8, 3, 2, sixTexels(4)).file();
  const auto with = [&](size_t at, uint64_t value, int bytes) {
    ByteVector wrong = file;
    put(wrong, at, value, bytes);
    return messageOf(wrong);
  };
  for (const uint64_t value : {uint64_t(1) << 40, ~uint64_t(0), ~uint64_t(0) - 8, uint64_t(file.size()) + 1}) {
    CHECK(with(80, value, 8).find("lies outside the file") != std::string::npos);  // offset of the level
    CHECK(with(88, value, 8).find("lies outside the file") != std::string::npos);  // its length
    CHECK(with(64, value, 8).find("lies outside the file") != std::string::npos);  // offset of global data
    CHECK(with(48, value, 4) != "");                                               // offset of the descriptor
    CHECK(with(56, 0xFFFFFF00, 4) != "");                                          // of key/value data
  }
  CHECK(with(20, 0, 4).find("width is 0") != std::string::npos);
  CHECK(with(20, 0xFFFFFFFF, 4).find("lies outside") == std::string::npos);
  CHECK(with(36, 3, 4).find("3 faces") != std::string::npos);
  CHECK(with(40, 33, 4).find("33 levels") != std::string::npos);
  CHECK(with(88, 23, 8) != "");  // a byte too few
}

TEST_CASE("KTX2: pictures that a file cannot hold are refused before memory is taken for them") {
  const ByteVector file = plain(kRgba8, 3, 2, sixTexels(4)).file();
  ByteVector wrong = file;
  put(wrong, 20, 1 << 15, 4);
  put(wrong, 24, 1 << 14, 4);
  CHECK(messageOf(wrong) == "is an image of 32768 x 16384 pixels, more than 2^28; make it smaller");
  put(wrong, 24, 1 << 13, 4);
  CHECK(messageOf(wrong).find("it claims 32768 x 8192 pixels in ") != std::string::npos);
  put(wrong, 20, 0xFFFFFFFF, 4);
  put(wrong, 24, 0xFFFFFFFF, 4);
  CHECK(messageOf(wrong).find("more than 2^28") != std::string::npos);
  // Many images of BasisLZ, which are only counted.
  Ktx2Writer many;
  many.model = 163;
  many.scheme = 1;
  many.layers = 0xFFFFFFFF;
  many.globalData = ByteVector(400, 1);
  many.levels[0] = ByteVector(400, 1);
  CHECK(messageOf(many.file()).find("is a broken KTX2 image") == 0);
  // A flat picture of a usual size is believed, however small its file is.
  Ktx2Writer flat = plain(kR8, 4096, 4096, {});
  flat.scheme = 2;
  flat.levels[0] = zstandard(ByteVector(4096 * 4096, 200));
  CHECK(flat.file().size() < 4096);
  CHECK(decode(flat.file()).bytes[3000000] == 200);
}

TEST_CASE("KTX2: key/value data that make no sense are passed over") {
  Ktx2Writer writer = plain(kRgba8, 3, 2, sixTexels(4));
  writer.keys["KTXorientation"] = "ru";
  const ByteVector file = writer.file();
  const auto pairs = static_cast<size_t>(file[56]) + 256 * static_cast<size_t>(file[57]);
  for (const uint64_t length : {uint64_t(0), uint64_t(1), uint64_t(3), uint64_t(1000), uint64_t(0xFFFFFFFF)}) {
    ByteVector wrong = file;
    put(wrong, pairs, length, 4);
    CHECK(decode(wrong).bytes == sixTexels(4));
  }
}

TEST_CASE("KTX2: normals of two channels get their third") {
  Image image;
  image.width = 3;
  image.height = 1;
  image.channels = 3;
  // Straight up; x = 1; x and y beyond the circle. 128 is 1/255 from the middle: z = sqrt(1 - 2/255²) is 1 to 2e-5.
  image.bytes = {128, 128, 0, 255, 128, 0, 255, 255, 0};
  CHECK(withNormalZ(image)->bytes == ByteVector{128, 128, 255, 255, 128, 128, 255, 255, 128});
  // x = 0.6, y = 0: z = 0.8, stored as 0.9.
  image.bytes.clear();
  image.floats = {0.8f, 0.5f, 0};
  image.width = 1;
  CHECK(withNormalZ(image)->floats[2] == doctest::Approx(0.9));
}

}  // namespace braid::test_texture_ktx2_container
