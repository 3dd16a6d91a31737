// SPDX-License-Identifier: Apache-2.0
// A file that is posed many times gives what it gives when it is loaded anew.
#include <algorithm>
#include <cstring>

#include "tests/support/gltf_fixture.h"

namespace braid::test_gltf_poses {

using namespace test;

namespace {

// A textured square that is moved, turned flat at its end, and morphed; and a second mesh that stays.
GltfFile movingFile() {
  GltfFile file = quadFile();
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", addTexture(file)}}}}}});
  const int target = file.accessor<float>({0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}, "VEC3");
  file.primitive()["targets"] = {{{"POSITION", target}}};
  file.root["nodes"].push_back({{"mesh", 1}, {"translation", {0, 3, 0}}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  file.root["meshes"].push_back(file.root["meshes"][0]);
  file.root["meshes"][1]["primitives"][0].erase("targets");
  const int times = file.accessor<float>({0, 1}, "SCALAR");
  Json animation = {{"name", "move"}, {"channels", Json::array()}, {"samplers", Json::array()}};
  const auto channel = [&](const char* path, int output) {
    animation["channels"].push_back(
        {{"sampler", animation["samplers"].size()}, {"target", {{"node", 0}, {"path", path}}}});
    animation["samplers"].push_back({{"input", times}, {"output", output}});
  };
  channel("translation", file.accessor<float>({0, 0, 0, 2, 0, 0}, "VEC3"));
  channel("scale", file.accessor<float>({1, 1, 1, 0, 0, 1}, "VEC3"));
  channel("weights", file.accessor<float>({0, 1}, "SCALAR"));
  channel("rotation", file.accessor<float>({0, 0, 0, 1}, "VEC4"));  // one key is missing: a flaw of every pose
  file.append("animations", animation);
  return file;
}

template <class T>
bool sameBytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void checkSame(const SceneData& a, const SceneData& b) {
  CHECK(a.contentHash == b.contentHash);
  CHECK(a.warnings == b.warnings);
  CHECK(a.notes == b.notes);
  CHECK(a.origin == b.origin);
  CHECK(a.textures.size() == b.textures.size());
  REQUIRE(a.meshes.size() == b.meshes.size());
  for (size_t m = 0; m < a.meshes.size(); ++m) {
    CHECK(sameBytes(a.meshes[m].positions, b.meshes[m].positions));
    CHECK(sameBytes(a.meshes[m].normals, b.meshes[m].normals));
    CHECK(sameBytes(a.meshes[m].triangles, b.meshes[m].triangles));
  }
  REQUIRE(a.instances.size() == b.instances.size());
  for (size_t i = 0; i < a.instances.size(); ++i) CHECK(a.instances[i].toWorld == b.instances[i].toWorld);
}

}  // namespace

TEST_CASE("gltf: poses of one open file are those of the file loaded anew, in any order") {
  const Folder folder;
  const std::string path = folder.write("moving.glb", movingFile().glb());
  LoadOptions options;
  options.frameTime = 0.0f;
  std::vector<std::string> told;
  SceneFile file(path, options, [&](LogLevel, const std::string& line) { told.push_back(line); });
  std::shared_ptr<const Image> pixels;
  for (const float time : {0.0f, 0.5f, 1.0f, 0.25f, 0.5f}) {
    CAPTURE(time);
    options.frameTime = time;
    const SceneData posed = file.pose(time);
    checkSame(posed, loadGltf(path, options));
    REQUIRE(!posed.textures.empty());
    if (pixels) CHECK(posed.textures[0].sharedImage() == pixels);  // decoded once
    pixels = posed.textures[0].sharedImage();
  }
  checkSame(file.pose({}), loadGltf(path));
  CHECK(file.pose(0.5f).instances[0].toWorld[3].x == 1);
  // Each warning is told once.
  std::sort(told.begin(), told.end());
  CHECK(std::adjacent_find(told.begin(), told.end()) == told.end());
  CHECK(!told.empty());
}

}  // namespace braid::test_gltf_poses
