// SPDX-License-Identifier: Apache-2.0
// AVIF textures of glTF files (EXT_texture_avif), beside twins with PNGs.
#include <string>

#include <doctest/doctest.h>

#include "tests/support/gltf_fixture.h"
#include "tests/support/textures/avif_writer.h"

namespace braid::test_gltf_avif {

using namespace braid::test;

namespace {

std::vector<uint8_t> onePixel(const std::vector<uint8_t>& rgba) { return avifOf(rgba, {}); }

// A texture that has an AVIF image, and tinyPng() beside it where `fallback`.
int addAvif(GltfFile& file, const std::vector<uint8_t>& avif, bool fallback) {
  const int texture = fallback ? addTexture(file) : file.append("textures", Json::object());
  const int image = file.append("images", {{"bufferView", file.view(avif)}, {"mimeType", "image/avif"}});
  file.root["textures"][static_cast<size_t>(texture)]["extensions"]["EXT_texture_avif"]["source"] = image;
  file.root["extensionsUsed"] = {"EXT_texture_avif"};
  if (!fallback) file.root["extensionsRequired"] = {"EXT_texture_avif"};
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  return texture;
}

const Image& baseImage(const SceneData& scene) {
  REQUIRE(scene.materials[0].baseColorTexture);
  return scene.textures[static_cast<size_t>(scene.materials[0].baseColorTexture.texture)].image();
}

}  // namespace

TEST_CASE("gltf: an AVIF texture gives what a PNG of the same pixel gives, required or not") {
  GltfFile png = quadFile();
  const int texture = addTexture(png);
  giveMaterial(png, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  const SceneData expected = png.load();
  GltfFile avif = quadFile();
  addAvif(avif, onePixel({10, 200, 30, 255}), false);
  const SceneData scene = avif.load();
  CHECK(baseImage(scene).bytes == baseImage(expected).bytes);
  CHECK(scene.textures[0].sample({0.3f, 0.6f}) == expected.textures[0].sample({0.3f, 0.6f}));
  CHECK(scene.extensionsIgnored.empty());
  CHECK(scene.warnings == expected.warnings);
}

TEST_CASE("gltf: an AVIF texture is preferred to WebP and the fallback, and gives way to KTX2") {
  GltfFile file = quadFile();
  const int texture = addAvif(file, onePixel({1, 2, 3, 255}), true);
  Json& extensions = file.root["textures"][static_cast<size_t>(texture)]["extensions"];
  extensions["EXT_texture_webp"]["source"] = file.append("images", {{"uri", "missing.webp"}});
  const SceneData scene = file.load();
  CHECK(baseImage(scene).bytes == std::vector<uint8_t>{1, 2, 3});
  CHECK_FALSE(hasWarning(scene, "missing.webp"));
  extensions["KHR_texture_basisu"]["source"] = file.append("images", {{"uri", "missing.ktx2"}});
  const SceneData second = file.load();
  CHECK(baseImage(second).bytes == std::vector<uint8_t>{1, 2, 3});
  CHECK(hasWarning(second, "missing.ktx2"));
}

TEST_CASE("gltf: an AVIF texture that cannot be read costs the texture only, or its fallback is used") {
  std::vector<uint8_t> cut = onePixel({1, 2, 3, 255});
  cut.resize(cut.size() - 4);
  GltfFile file = quadFile();
  addAvif(file, cut, false);
  const SceneData scene = file.load();
  CHECK_FALSE(scene.materials[0].baseColorTexture);
  CHECK(hasWarning(scene, "/images/0"));
  CHECK(hasWarning(scene, "factors alone are used"));
  GltfFile other = quadFile();
  addAvif(other, cut, true);
  const SceneData withFallback = other.load();
  CHECK(baseImage(withFallback).bytes == std::vector<uint8_t>{10, 200, 30});
  CHECK(hasWarning(withFallback, "the texture's other image is used"));
}

}  // namespace braid::test_gltf_avif
