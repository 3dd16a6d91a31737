// SPDX-License-Identifier: Apache-2.0
// What a file holds beside surfaces and lights: a trait and a line of the plan each, left out where it holds none.
#include <string>

#include <doctest/doctest.h>

#include "renderer/scene/file_parts.h"
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tests/support/textures/avif_writer.h"
#include "tests/support/textures/cube_file.h"
#include "tests/support/textures/ktx2_writer.h"

namespace braid::test_scene_parts {

using namespace braid::test;

namespace {

struct Told {
  std::vector<std::string> traits;
  std::string plan;
};

Told toldOf(SceneData data) {
  const Scene scene(std::move(data));
  return {scene.traits().names(),
          makePlan(scene, scene.data().cameras.at(0), settingsFor(4, 4, 1), integrators()).text()};
}

// Loads the file, in which there is this number of one part and nothing of the others.
void checkOnly(FilePart part, uint64_t number, const GltfFile& file,
               const LoadOptions& options = GltfFile::plainLight()) {
  const Told told = toldOf(file.load(options));
  for (size_t i = 0; i < kFileParts; ++i) {
    const FilePartEntry& words = kFilePartTable[i];
    CAPTURE(std::string(words.part));
    const bool held = i == static_cast<size_t>(part);
    CHECK(std::count(told.traits.begin(), told.traits.end(), words.trait) == (held ? 1 : 0));
    const std::string line = held ? std::string("+ ") + words.part + ": " + words.kept + ": " + std::to_string(number)
                                  : std::string("- ") + words.part + ": " + words.left;
    CHECK(contains(told.plan, line + '\n'));
  }
}

// A material whose base colour is an image of this type, named by an extension.
GltfFile textured(const std::vector<uint8_t>& bytes, const char* type, const char* extension) {
  GltfFile file = quadFile();
  const int image = file.append("images", {{"bufferView", file.view(bytes)}, {"mimeType", type}});
  const int texture = file.append("textures", {{"extensions", {{extension, {{"source", image}}}}}});
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  file.root["extensionsUsed"] = file.root["extensionsRequired"] = {extension};
  return file;
}

GltfFile moved(const std::string& pointer, const std::vector<float>& values) {
  GltfFile file = quadFile();
  giveMaterial(file, {{"pbrMetallicRoughness", {{"roughnessFactor", 0}}}});
  file.root["animations"] = {
      {{"samplers",
        {{{"input", file.accessor<float>({0, 2}, "SCALAR")}, {"output", file.accessor<float>(values, "SCALAR")}}}},
       {"channels",
        {{{"sampler", 0},
          {"target", {{"path", "pointer"}, {"extensions", {{"KHR_animation_pointer", {{"pointer", pointer}}}}}}}}}}}};
  return file;
}

}  // namespace

TEST_CASE("file parts: a plain file has none, each has words of its own") {
  const Told told = toldOf(quadFile().load());
  for (const FilePartEntry& words : kFilePartTable) {
    CHECK(contains(told.plan, std::string("- ") + words.part + ": " + words.left + '\n'));
    CHECK(std::count_if(kFilePartTable.begin(), kFilePartTable.end(), [&](const FilePartEntry& other) {
            return std::string(other.trait) == words.trait || std::string(other.part) == words.part;
          }) == 1);
  }
}

TEST_CASE("file parts: KTX2 and AVIF images are counted where they are read") {
  Ktx2Writer ktx2;
  ktx2.vkFormat = 37;  // R8G8B8A8_UNORM
  ktx2.width = ktx2.height = 1;
  ktx2.levels[0] = {10, 20, 30, 255};
  checkOnly(FilePart::Ktx2Images, 1, textured(ktx2.file(), "image/ktx2", "KHR_texture_basisu"));
  checkOnly(FilePart::AvifImages, 1,
            textured(avifOf(std::vector<uint8_t>{1, 2, 3, 255}, {}), "image/avif", "EXT_texture_avif"));

  // Beside an image that is read, one that nobody reads is no reason for a decoder.
  GltfFile unread = textured(ktx2.file(), "image/ktx2", "KHR_texture_basisu");
  unread.primitive().erase("material");
  CHECK(unread.load().parts == FilePartCounts{});
}

TEST_CASE("file parts: animated properties count where the pose is moved") {
  const GltfFile file = moved("/materials/0/pbrMetallicRoughness/roughnessFactor", {0, 1});
  LoadOptions options = GltfFile::plainLight();
  CHECK(file.load(options).parts == FilePartCounts{});
  options.frameTime = 1.0f;
  checkOnly(FilePart::AnimatedProperties, 1, file, options);

  const Folder folder;
  SceneFile scene(folder.write("scene.glb", file.glb()), options);
  for (int turn = 0; turn < 2; ++turn)
    CHECK(scene.pose(1.0f).parts[static_cast<size_t>(FilePart::AnimatedProperties)] == 1);
}

TEST_CASE("file parts: hidden nodes, points as spheres, the image-based light of the file") {
  GltfFile hidden = quadFile();
  hidden.append("nodes", {{"mesh", 0}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  hidden.root["scenes"][0]["nodes"] = {0, 1};
  checkOnly(FilePart::HiddenNodes, 1, hidden);

  GltfFile points = quadFile();
  Json stroke = {{"attributes", points.primitive()["attributes"]}, {"mode", 0}};
  points.root["meshes"][0]["primitives"].push_back(stroke);
  LoadOptions thick = GltfFile::plainLight();
  CHECK(points.load(thick).parts == FilePartCounts{});
  thick.pointRadius = 0.1f;
  checkOnly(FilePart::RoundPrimitives, 1, points, thick);

  const GltfFile cube = cubeFile(4, [](size_t, int, int) { return std::vector<uint8_t>{255, 255, 255, 255}; });
  checkOnly(FilePart::ImageBasedLight, 1, cube);
  LoadOptions other = GltfFile::plainLight();
  other.imageBasedLight = false;
  CHECK(cube.load(other).parts == FilePartCounts{});
}

}  // namespace braid::test_scene_parts
