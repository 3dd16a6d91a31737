// SPDX-License-Identifier: Apache-2.0
// KTX2 textures of glTF files (KHR_texture_basisu), beside twins with PNGs.
#include <algorithm>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "tests/support/gltf_fixture.h"
#include "tests/support/textures/ktx2_writer.h"

namespace braid::test_gltf_ktx2 {

using namespace braid::test;

namespace {

enum : uint32_t { kRgba8 = 37, kRgba8Srgb = 43, kRg8 = 16 };

Ktx2Writer plain(uint32_t format, uint32_t width, uint32_t height, const ByteVector& texels) {
  Ktx2Writer file;
  file.vkFormat = format;
  file.transfer = format == kRgba8Srgb ? 2 : 1;
  file.width = width;
  file.height = height;
  file.levels[0] = texels;
  return file;
}

// A texture that has a KTX2 file, and tinyPng() beside it where `fallback`.
int addKtx2(GltfFile& file, const ByteVector& ktx2, bool fallback) {
  const int texture = fallback ? addTexture(file) : file.append("textures", Json::object());
  const int image = file.append("images", {{"bufferView", file.view(ktx2)}, {"mimeType", "image/ktx2"}});
  file.root["textures"][static_cast<size_t>(texture)]["extensions"]["KHR_texture_basisu"]["source"] = image;
  file.root["extensionsUsed"] = {"KHR_texture_basisu"};
  if (!fallback) file.root["extensionsRequired"] = {"KHR_texture_basisu"};
  return texture;
}

void useAsBaseColour(GltfFile& file, int texture) {
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
}

const Image& baseImage(const SceneData& scene) {
  REQUIRE(scene.materials[0].baseColorTexture);
  return scene.textures[static_cast<size_t>(scene.materials[0].baseColorTexture.texture)].image();
}

// Beside that there are no camera and no light.
size_t textureWarnings(const SceneData& scene) {
  return static_cast<size_t>(std::count_if(scene.warnings.begin(), scene.warnings.end(), [](const std::string& line) {
    return line.find("/images/") != std::string::npos || line.find("/textures/") != std::string::npos;
  }));
}

const ByteVector kTexels = {10, 20, 30, 255, 200, 100, 50, 128};

}  // namespace

TEST_CASE("gltf: KHR_texture_basisu is read, with and without a fallback, whether required or not") {
  for (const bool fallback : {true, false}) {
    GltfFile file = quadFile();
    useAsBaseColour(file, addKtx2(file, plain(kRgba8Srgb, 2, 1, kTexels).file(), fallback));
    const SceneData scene = file.load();
    CHECK(baseImage(scene).bytes == kTexels);
    CHECK(baseImage(scene).channels == 4);
    CHECK(textureWarnings(scene) == 0);
    CHECK(scene.extensionsIgnored.empty());
    CHECK(scene.extensionsUsed == std::vector<std::string>{"KHR_texture_basisu"});
  }
}

TEST_CASE("gltf: a KTX2 texture gives what a PNG of the same pixel gives") {
  GltfFile png = quadFile();
  useAsBaseColour(png, addTexture(png));
  const SceneData expected = png.load();
  REQUIRE(baseImage(expected).bytes == ByteVector{10, 200, 30});
  GltfFile ktx2 = quadFile();
  useAsBaseColour(ktx2, addKtx2(ktx2, plain(kRgba8Srgb, 1, 1, {10, 200, 30, 255}).file(), false));
  const SceneData scene = ktx2.load();
  const auto sample = [](const SceneData& s) {
    return s.textures[static_cast<size_t>(s.materials[0].baseColorTexture.texture)].sample({0.3f, 0.6f});
  };
  CHECK(sample(scene) == sample(expected));
}

TEST_CASE("gltf: external KTX2 files, by URI") {
  GltfFile file = quadFile();
  const int texture = addKtx2(file, plain(kRgba8Srgb, 2, 1, kTexels).file(), false);
  file.root["images"][0] = {{"uri", "leaf.ktx2"}};
  useAsBaseColour(file, texture);
  const Folder folder;
  const ByteVector bytes = plain(kRgba8Srgb, 2, 1, kTexels).file();
  folder.write("leaf.ktx2", {bytes.begin(), bytes.end()});
  const SceneData scene = loadGltf(folder.write("scene.glb", file.glb()), GltfFile::plainLight());
  CHECK(baseImage(scene).bytes == kTexels);
}

TEST_CASE("gltf: a KTX2 texture that cannot be read costs the texture only, or its fallback is used") {
  Ktx2Writer astc = plain(kRgba8Srgb, 2, 1, kTexels);
  astc.vkFormat = 158;
  ByteVector cut = plain(kRgba8Srgb, 2, 1, kTexels).file();
  cut.pop_back();
  for (const ByteVector& bytes : {astc.file(), cut}) {
    GltfFile file = quadFile();
    useAsBaseColour(file, addKtx2(file, bytes, false));
    const SceneData scene = file.load();
    CHECK_FALSE(scene.materials[0].baseColorTexture);
    REQUIRE(textureWarnings(scene) == 1);
    CHECK(hasWarning(scene, "/images/0: is a "));
    CHECK(hasWarning(scene, "KTX2 image"));
    CHECK(hasWarning(scene, "factors alone are used"));
    GltfFile other = quadFile();
    useAsBaseColour(other, addKtx2(other, bytes, true));
    const SceneData withFallback = other.load();
    CHECK(baseImage(withFallback).width == 1);
    CHECK(hasWarning(withFallback, "the texture's other image is used"));
    CHECK(textureWarnings(withFallback) == 1);
  }
}

TEST_CASE("gltf: two textures of which one KTX2 file is broken keep the rest") {
  GltfFile file = quadFile();
  ByteVector broken = plain(kRgba8Srgb, 2, 1, kTexels).file();
  broken.pop_back();
  const int good = addKtx2(file, plain(kRgba8Srgb, 2, 1, kTexels).file(), false);
  const int bad = addKtx2(file, broken, false);
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", good}}}}},
                      {"emissiveFactor", {1, 1, 1}},
                      {"emissiveTexture", {{"index", bad}}}});
  const SceneData scene = file.load();
  CHECK(baseImage(scene).bytes == kTexels);
  CHECK_FALSE(scene.materials[0].emissiveTexture);
}

TEST_CASE("gltf: KTX2 textures of several layers, and of another transfer function, are told") {
  GltfFile file = quadFile();
  Ktx2Writer layers = plain(kRgba8Srgb, 1, 1, {1, 2, 3, 4, 5, 6, 7, 8});
  layers.layers = 2;
  useAsBaseColour(file, addKtx2(file, layers.file(), false));
  const SceneData scene = file.load();
  CHECK(baseImage(scene).bytes == ByteVector{1, 2, 3, 4});
  CHECK(hasWarning(scene, "several layers, faces or frames; the first is used"));
  GltfFile linear = quadFile();
  useAsBaseColour(linear, addKtx2(linear, plain(kRgba8, 2, 1, kTexels).file(), false));
  CHECK(hasWarning(linear.load(), "says that its colours are linear"));
  GltfFile normal = quadFile();
  giveMaterial(normal,
               {{"normalTexture", {{"index", addKtx2(normal, plain(kRgba8Srgb, 2, 1, kTexels).file(), false)}}}});
  CHECK(hasWarning(normal.load(), "says that it holds sRGB colours"));
}

TEST_CASE("gltf: normal maps of two channels are completed, other textures of two are not") {
  GltfFile file = quadFile();
  const ByteVector texels = {128, 128, 255, 128};
  giveMaterial(file,
               {{"normalTexture", {{"index", addKtx2(file, plain(kRg8, 2, 1, texels).file(), false)}}},
                {"pbrMetallicRoughness",
                 {{"metallicRoughnessTexture", {{"index", addKtx2(file, plain(kRg8, 1, 2, texels).file(), false)}}}}}});
  const SceneData scene = file.load();
  const Material& m = scene.materials[0];
  CHECK(scene.textures[static_cast<size_t>(m.normalTexture.texture)].image().bytes ==
        ByteVector{128, 128, 255, 255, 128, 128});
  CHECK(scene.textures[static_cast<size_t>(m.metallicRoughnessTexture.texture)].image().bytes ==
        ByteVector{128, 128, 0, 255, 128, 0});
  CHECK(textureWarnings(scene) == 0);
}

TEST_CASE("gltf: 16-bit KTX2 colours are linear unless the file says sRGB") {
  for (const uint8_t transfer : {uint8_t(1), uint8_t(2)}) {
    GltfFile file = quadFile();
    Ktx2Writer shorts = plain(91, 1, 1, {0, 0x80, 0, 0x80, 0, 0x80, 0xFF, 0xFF});
    shorts.transfer = transfer;
    useAsBaseColour(file, addKtx2(file, shorts.file(), false));
    const SceneData scene = file.load();
    const Vec4 texel =
        scene.textures[static_cast<size_t>(scene.materials[0].baseColorTexture.texture)].sample({0.5f, 0.5f});
    // 0.5 in linear light, or what sRGB's 0.5 is.
    CHECK(texel.x == doctest::Approx(transfer == 1 ? 0.5000076 : 0.2140489).epsilon(1e-5));
  }
}

}  // namespace braid::test_gltf_ktx2
