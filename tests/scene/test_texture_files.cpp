// SPDX-License-Identifier: Apache-2.0
// Decoding of image files to textures, without colour management.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <doctest/doctest.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>
#include <webp/encode.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/scene/data/textures/texture.h"
#include "tests/support/textures/ktx2_writer.h"

namespace braid::test_texture_files {

namespace fs = std::filesystem;

namespace {

float fromSrgb(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

// Writes pixels with OpenImageIO and returns the encoded bytes.
std::vector<uint8_t> encoded(const std::string& extension, OIIO::ImageSpec spec, OIIO::TypeDesc type,
                             const void* pixels) {
  const fs::path path = fs::temp_directory_path() / ("braid-test-texture-" + std::to_string(::getpid()) + extension);
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(type, pixels));
  output->close();
  std::ifstream stream(path, std::ios::binary);
  std::vector<uint8_t> bytes((std::istreambuf_iterator<char>(stream)), {});
  fs::remove(path);
  return bytes;
}

// 2 x 2 RGBA with a gAMA chunk that asks for no correction at all: (128,64,32,128) (255,0,0,0) / (0,255,0,255)
// (1,2,3,4).
const std::vector<uint8_t> kGammaPng{0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
                                     0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x02, 0x08, 0x06, 0x00, 0x00,
                                     0x00, 0x72, 0xb6, 0x0d, 0x24, 0x00, 0x00, 0x00, 0x04, 0x67, 0x41, 0x4d, 0x41, 0x00,
                                     0x01, 0x86, 0xa0, 0x31, 0xe8, 0x96, 0x5f, 0x00, 0x00, 0x00, 0x18, 0x49, 0x44, 0x41,
                                     0x54, 0x78, 0xda, 0x63, 0x68, 0x70, 0x50, 0x68, 0xf8, 0xcf, 0x00, 0x02, 0xff, 0x19,
                                     0xfe, 0x33, 0x32, 0x31, 0xb3, 0x00, 0x00, 0x2e, 0x6d, 0x04, 0x68, 0x7c, 0x63, 0xa1,
                                     0x8a, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

// Its header claims 100000 x 100000 pixels.
const std::vector<uint8_t> kBombPng{0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48,
                                    0x44, 0x52, 0x00, 0x01, 0x86, 0xa0, 0x00, 0x01, 0x86, 0xa0, 0x08, 0x02, 0x00, 0x00,
                                    0x00, 0x27, 0x30, 0x9c, 0x9f, 0x00, 0x00, 0x00, 0x0b, 0x49, 0x44, 0x41, 0x54, 0x78,
                                    0x9c, 0x63, 0x60, 0x80, 0x01, 0x00, 0x00, 0x0a, 0x00, 0x01, 0x7f, 0x80, 0x74, 0x5e,
                                    0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

}  // namespace

TEST_CASE("texture: PNG colours stay as stored, whatever alpha and gamma say") {
  const auto image = decodeImage(kGammaPng.data(), kGammaPng.size(), "gamma");
  CHECK(image->width == 2);
  CHECK(image->channels == 4);
  CHECK(image->bytes == std::vector<uint8_t>{128, 64, 32, 128, 255, 0, 0, 0, 0, 255, 0, 255, 1, 2, 3, 4});
}

TEST_CASE("texture: 16-bit PNG keeps its precision and is decoded as sRGB only for colours") {
  const uint16_t pixels[3] = {32768, 257, 65535};
  const std::vector<uint8_t> bytes =
      encoded(".png", OIIO::ImageSpec(1, 1, 3, OIIO::TypeDesc::UINT16), OIIO::TypeDesc::UINT16, pixels);
  const auto image = decodeImage(bytes.data(), bytes.size(), "deep");
  REQUIRE(image->floats.size() == 3);
  const Texture data(image, false, Wrap::Repeat, Wrap::Repeat, Filter::Linear),
      colour(image, true, Wrap::Repeat, Wrap::Repeat, Filter::Linear);
  CHECK(data.sample({0, 0}).x == doctest::Approx(32768.0 / 65535));
  CHECK(colour.sample({0, 0}).x == doctest::Approx(fromSrgb(32768.0f / 65535)));
  CHECK(colour.sample({0, 0}).z == doctest::Approx(1));
}

TEST_CASE("texture: JPEG and WebP") {
  std::vector<uint8_t> pixels(16 * 16 * 3);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(60 + 60 * (i % 3));
  for (const std::string extension : {".jpg", ".webp"}) {
    CAPTURE(extension);
    const std::vector<uint8_t> bytes =
        encoded(extension, OIIO::ImageSpec(16, 16, 3, OIIO::TypeDesc::UINT8), OIIO::TypeDesc::UINT8, pixels.data());
    const auto image = decodeImage(bytes.data(), bytes.size(), "picture");
    CHECK(image->width == 16);
    REQUIRE(image->channels >= 3);
    CHECK(std::abs(image->bytes[0] - 60) < 8);
    CHECK(std::abs(image->bytes[2] - 180) < 8);
  }
}

namespace {

// Two texels, (200,100,50) of alpha 64 and (10,20,30) of alpha 0.
const std::vector<uint8_t> kTwoTexels{200, 100, 50, 64, 10, 20, 30, 0};

// Those of a file, as bytes.
std::vector<int> texelsOf(const std::vector<uint8_t>& file) {
  const auto image = decodeImage(file.data(), file.size(), "x");
  REQUIRE(image->width == 2);
  std::vector<int> texels(image->bytes.begin(), image->bytes.end());
  for (const float v : image->floats) texels.push_back(static_cast<int>(std::lround(v * 255)));
  return texels;
}

std::vector<uint8_t> webpOf(const std::vector<uint8_t>& rgba, int width, int height, float quality) {
  WebPConfig config;
  WebPPicture picture;
  REQUIRE(WebPConfigInit(&config));
  REQUIRE(WebPPictureInit(&picture));
  config.lossless = quality < 0;
  config.exact = 1;  // keeps colours under alpha 0
  if (quality >= 0) config.quality = quality;
  picture.use_argb = config.lossless;
  picture.width = width;
  picture.height = height;
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  REQUIRE(WebPPictureImportRGBA(&picture, rgba.data(), width * 4));
  REQUIRE(WebPEncode(&config, &picture));
  std::vector<uint8_t> bytes(writer.mem, writer.mem + writer.size);
  WebPMemoryWriterClear(&writer);
  WebPPictureFree(&picture);
  return bytes;
}

}  // namespace

TEST_CASE("texture: colours are not multiplied by alpha, in any format") {
  const std::vector<int> stored(kTwoTexels.begin(), kTwoTexels.end());
  OIIO::ImageSpec spec(2, 1, 4, OIIO::TypeDesc::UINT8);
  CHECK(texelsOf(encoded(".png", spec, OIIO::TypeDesc::UINT8, kTwoTexels.data())) == stored);
  CHECK(texelsOf(encoded(".tif", spec, OIIO::TypeDesc::UINT8, kTwoTexels.data())) == stored);
  CHECK(texelsOf(webpOf(kTwoTexels, 2, 1, -1)) == stored);
  spec.set_format(OIIO::TypeDesc::UINT16);
  CHECK(texelsOf(encoded(".png", spec, OIIO::TypeDesc::UINT8, kTwoTexels.data())) == stored);

  // The same as a palette with a tRNS chunk.
  const std::vector<uint8_t> palette{
      0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00,
      0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x03, 0x00, 0x00, 0x00, 0xc3, 0xfc, 0x8f, 0xb8, 0x00,
      0x00, 0x00, 0x06, 0x50, 0x4c, 0x54, 0x45, 0xc8, 0x64, 0x32, 0x0a, 0x14, 0x1e, 0xb7, 0x7a, 0xab, 0x51,
      0x00, 0x00, 0x00, 0x02, 0x74, 0x52, 0x4e, 0x53, 0x40, 0x00, 0x86, 0xea, 0x82, 0x3d, 0x00, 0x00, 0x00,
      0x0b, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0x60, 0x04, 0x00, 0x00, 0x04, 0x00, 0x02, 0xbf,
      0x7a, 0x3f, 0x4a, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
  CHECK(texelsOf(palette) == stored);

  // Grey with alpha.
  OIIO::ImageSpec greySpec(2, 1, 2, OIIO::TypeDesc::UINT8);
  greySpec.channelnames = {"Y", "A"};
  greySpec.alpha_channel = 1;
  const uint8_t greys[4] = {200, 64, 10, 0};
  CHECK(texelsOf(encoded(".png", greySpec, OIIO::TypeDesc::UINT8, greys)) == std::vector<int>{200, 64, 10, 0});

  // Formats that store products: what is under alpha 0 is lost in them.
  const float products[8] = {0.8f * 0.25f, 0.4f * 0.25f, 2 * 0.25f, 0.25f, 0, 0, 0, 0};
  const auto exr = encoded(".exr", OIIO::ImageSpec(2, 1, 4, OIIO::TypeDesc::FLOAT), OIIO::TypeDesc::FLOAT, products);
  const auto floats = decodeImage(exr.data(), exr.size(), "x")->floats;
  REQUIRE(floats.size() == 8);
  for (size_t c = 0; c < 3; ++c) CHECK(floats[c] == doctest::Approx(4 * products[c]));
  CHECK(floats[3] == 0.25f);
}

TEST_CASE("texture: images to compare have the same colours as PNG and as WebP") {
  const fs::path folder = fs::temp_directory_path();
  const std::string stem = "braid-test-texture-" + std::to_string(::getpid());
  const auto write = [&](const std::string& extension, const std::vector<uint8_t>& bytes) {
    const fs::path path = folder / (stem + extension);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    ImageFile image = readImage(path);
    fs::remove(path);
    return image;
  };
  const OIIO::ImageSpec spec(2, 1, 4, OIIO::TypeDesc::UINT8);
  const ImageFile png = write(".png", encoded(".png", spec, OIIO::TypeDesc::UINT8, kTwoTexels.data()));
  const ImageFile webp = write(".webp", webpOf(kTwoTexels, 2, 1, -1));
  CHECK(png.planes.at("R").at(0, 0) == doctest::Approx(fromSrgb(200 / 255.0f) * 64 / 255));
  for (const char* c : {"R", "G", "B", "A"})
    for (const int x : {0, 1}) {
      // Products of eight bits.
      CHECK(webp.planes.at(c).at(x, 0) == doctest::Approx(png.planes.at(c).at(x, 0)).epsilon(0.05));
    }
}

TEST_CASE("texture: lossy WebP, WebP without alpha, and broken WebP") {
  std::vector<uint8_t> plain;
  for (int i = 0; i < 16 * 16; ++i) plain.insert(plain.end(), {200, 100, 50, 255});
  const std::vector<uint8_t> opaque = webpOf(plain, 16, 16, -1);
  const auto three = decodeImage(opaque.data(), opaque.size(), "x");
  CHECK(three->channels == 3);
  CHECK(three->bytes[3 * 17 + 1] == 100);

  std::vector<uint8_t> veiled = plain;
  for (size_t i = 3; i < veiled.size(); i += 4) veiled[i] = 64;
  const std::vector<uint8_t> lossy = webpOf(veiled, 16, 16, 90);
  const auto image = decodeImage(lossy.data(), lossy.size(), "x");
  REQUIRE(image->channels == 4);
  CHECK(std::abs(image->bytes[0] - 200) < 8);
  CHECK(std::abs(image->bytes[2] - 50) < 8);
  CHECK(image->bytes[3] == 64);

  const std::vector<uint8_t> cut(lossy.begin(), lossy.begin() + static_cast<ptrdiff_t>(lossy.size() / 2));
  CHECK_THROWS_AS(decodeImage(cut.data(), cut.size(), "x"), Error);
  CHECK_THROWS_AS(decodeImage(lossy.data(), 13, "x"), Error);

  // 16383 x 16383 texels of one colour in a few bytes: refused before anything is allocated.
  std::vector<uint8_t> bomb = opaque;
  bomb[21] = 0xff, bomb[22] = bomb[23] = 0xff;
  bomb[24] = static_cast<uint8_t>(bomb[24] | 0x0f);
  CHECK_THROWS_WITH_AS(decodeImage(bomb.data(), bomb.size(), "x"), doctest::Contains("damaged"), Error);
}

TEST_CASE("texture: EXR texels that are not finite become 0") {
  const float pixels[6] = {1, std::numeric_limits<float>::quiet_NaN(), 3, std::numeric_limits<float>::infinity(), 5, 6};
  const std::vector<uint8_t> bytes =
      encoded(".exr", OIIO::ImageSpec(2, 1, 3, OIIO::TypeDesc::FLOAT), OIIO::TypeDesc::FLOAT, pixels);
  CHECK(decodeImage(bytes.data(), bytes.size(), "hdr")->floats == std::vector<float>{1, 0, 3, 0, 5, 6});
}

TEST_CASE("texture: KTX2 files are read by path, as environments are") {
  test::Ktx2Writer file;
  file.vkFormat = 109;
  file.width = 1;
  file.height = 1;
  file.levels[0] = {0, 0, 0x80, 0x3F, 0, 0, 0, 0x40, 0, 0, 0x80, 0x3E, 0, 0, 0x80, 0x3F};  // 1, 2, 1/4, 1
  const fs::path path = fs::temp_directory_path() / ("braid-test-" + std::to_string(::getpid()) + ".ktx2");
  const auto bytes = file.file();
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  const auto image = readImageFile(path.string());
  CHECK(image->floats == std::vector<float>{1, 2, 0.25f, 1});
  CHECK_FALSE(image->integerFloats);
  fs::resize_file(path, bytes.size() - 1);
  CHECK_THROWS_WITH_AS(readImageFile(path.string()), doctest::Contains("braid-test-"), Error);
  fs::remove(path);
}

TEST_CASE("texture: what cannot be decoded is an error of one line") {
  const auto reason = [](const std::vector<uint8_t>& bytes) {
    try {
      decodeImage(bytes.data(), bytes.size(), "x");
      return std::string();
    } catch (const Error& error) {
      CHECK(error.code() == ExitCode::BadInput);
      CHECK(std::string(error.what()).find('\n') == std::string::npos);
      return std::string(error.what());
    }
  };
  CHECK(reason({}).find("empty") != std::string::npos);
  CHECK(reason({1, 2, 3, 4}).find("known format") != std::string::npos);
  CHECK(reason(std::vector<uint8_t>(kGammaPng.begin(), kGammaPng.begin() + 60)) != "");
  CHECK(reason(kBombPng).find("more than 2^28") != std::string::npos);
  CHECK(reason({0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'}).find("KTX2") != std::string::npos);
  CHECK_THROWS_AS(readImageFile("/no/such/image.png"), Error);
}

}  // namespace braid::test_texture_files
