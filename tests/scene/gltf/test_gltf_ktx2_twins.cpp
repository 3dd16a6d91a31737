// SPDX-License-Identifier: Apache-2.0
// One picture as PNG and as KTX2 of every kind: scenes that show it are equal, or as near as the kind allows.
#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <zlib.h>

#include "braid/braid.h"
#include "renderer/scene/data/textures/texture.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/textures/basis_lz_writer.h"

namespace braid::test_gltf_ktx2_twins {

using namespace braid::test;

namespace {

constexpr uint32_t kSide = 8;

// Four blocks of one colour each.
constexpr std::array<std::array<uint8_t, 3>, 4> kColours = {
    {{{200, 40, 10}}, {{3, 130, 77}}, {{255, 255, 255}}, {{90, 0, 180}}}};

const std::array<uint8_t, 3>& colourAt(uint32_t x, uint32_t y) { return kColours[y / 4 * 2 + x / 4]; }

void appendBigEndian(ByteVector& out, uint64_t value) {
  for (int i = 3; i >= 0; --i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

ByteVector png() {
  ByteVector rows;
  for (uint32_t y = 0; y < kSide; ++y) {
    rows.push_back(0);
    for (uint32_t x = 0; x < kSide; ++x) append(rows, {colourAt(x, y).begin(), colourAt(x, y).end()});
  }
  ByteVector packed(compressBound(rows.size()));
  uLongf size = packed.size();
  REQUIRE(compress(packed.data(), &size, rows.data(), rows.size()) == Z_OK);
  packed.resize(size);
  ByteVector out = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  const auto chunk = [&](const std::string& kind, const ByteVector& data) {
    ByteVector body(kind.begin(), kind.end());
    append(body, data);
    appendBigEndian(out, data.size());
    append(out, body);
    appendBigEndian(out, crc32(0, body.data(), static_cast<uInt>(body.size())));
  };
  chunk("IHDR", {0, 0, 0, kSide, 0, 0, 0, kSide, 8, 2, 0, 0, 0});
  chunk("IDAT", packed);
  chunk("IEND", {});
  return out;
}

Ktx2Writer ktx2() {
  Ktx2Writer file;
  file.width = file.height = kSide;
  file.transfer = 2;
  return file;
}

ByteVector plain() {
  Ktx2Writer file = ktx2();
  file.vkFormat = 29;
  for (uint32_t y = 0; y < kSide; ++y)
    for (uint32_t x = 0; x < kSide; ++x) append(file.levels[0], {colourAt(x, y).begin(), colourAt(x, y).end()});
  return file.file();
}

ByteVector uastc() {
  Ktx2Writer file = ktx2();
  file.model = 166;
  for (const auto& colour : kColours) {
    BitWriter block;
    block.put(0x17, 5);
    for (const uint8_t channel : colour) block.put(channel, 8);
    block.put(255, 8);
    block.put(0, 128 - 37);
    append(file.levels[0], block.bytes());
  }
  return file.file();
}

// Each colour by the nearest one of five bits, two less, which the brighter small step adds.
ByteVector etc1s() {
  std::mt19937 random(1);
  std::vector<WrittenEndpoint> endpoints;
  const auto nearest = [](uint8_t value) { return (std::max(0, value - 2) * 31 + 127) / 255; };
  for (const auto& c : kColours) endpoints.push_back({nearest(c[0]), nearest(c[1]), nearest(c[2]), 0});
  WrittenSelector brighter;
  brighter.fill(2);
  const SliceWriter slices(endpoints.size(), 1, 4, random);
  Ktx2Writer file = ktx2();
  file.model = 163;
  file.scheme = 1;
  file.levels[0] = slices.slice({{0, 0}, {1, 0}, {2, 0}, {3, 0}}, 2, 2);
  file.globalData = globalData({writeEndpoints(endpoints, false), writeSelectors({brighter}, true), slices.tables()},
                               endpoints.size(), 1, file.levels[0].size(), 0);
  return file.file();
}

GltfFile sceneWith(const ByteVector& image) {
  GltfFile file = quadFile();
  const bool isPng = image[1] == 'P';
  const int source =
      file.append("images", {{"bufferView", file.view(image)}, {"mimeType", isPng ? "image/png" : "image/ktx2"}});
  Json texture = {{"source", source}};
  if (!isPng) {
    texture = {{"extensions", {{"KHR_texture_basisu", {{"source", source}}}}}};
    file.root["extensionsUsed"] = file.root["extensionsRequired"] = {"KHR_texture_basisu"};
  }
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", file.append("textures", texture)}}}}}});
  return file;
}

std::vector<float> rendered(const GltfFile& file, const std::string& integrator) {
  const Folder folder;
  const auto scene = load(folder.write("scene.glb", file.glb()), GltfFile::plainLight());
  Settings settings;
  settings.width = settings.height = 16;
  settings.spp = 4;
  settings.threads = 1;
  settings.integrators = {integrator};
  std::vector<float> values;
  for (const auto& [name, plane] : render(*scene, plan(*scene, settings)).planes)
    values.insert(values.end(), plane.data.begin(), plane.data.end());
  return values;
}

}  // namespace

TEST_CASE("gltf: a picture as PNG, as plain KTX2 and as UASTC renders to the same bits, by every integrator") {
  for (const char* integrator : {"pt", "crn", "gdpt", "bdpt", "vcm", "sppm"}) {
    CAPTURE(std::string(integrator));
    const std::vector<float> expected = rendered(sceneWith(png()), integrator);
    CHECK(expected.size() >= 16 * 16 * 3);
    CHECK(rendered(sceneWith(plain()), integrator) == expected);
    CHECK(rendered(sceneWith(uastc()), integrator) == expected);
    CHECK(rendered(sceneWith(etc1s()), integrator) != expected);
  }
}

TEST_CASE("gltf: a picture as ETC1S is within its five bits of the PNG") {
  const SceneData exact = sceneWith(png()).load(), coarse = sceneWith(etc1s()).load();
  REQUIRE(exact.textures.size() == 1);
  REQUIRE(coarse.textures.size() == 1);
  const Image &a = exact.textures[0].image(), &b = coarse.textures[0].image();
  REQUIRE(a.bytes.size() == kSide * kSide * 3);
  REQUIRE(b.bytes.size() == a.bytes.size());
  // Steps of five bits are at most 9 apart: 4.5, and one of rounding; the darkest has 2 at least.
  for (size_t i = 0; i < a.bytes.size(); ++i) CHECK(std::abs(int(a.bytes[i]) - int(b.bytes[i])) <= 5);
}

}  // namespace braid::test_gltf_ktx2_twins
