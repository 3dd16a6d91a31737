// SPDX-License-Identifier: Apache-2.0
// KHR_animation_pointer: properties at a time, beside files that have the value at rest.
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "tests/support/gltf_fixture.h"

namespace braid::test_gltf_pointers {

using namespace braid::test;

namespace {

// Adds a channel to clip 0 that moves what the pointer leads to from the first to the second value in 2 seconds.
void animate(GltfFile& file, const std::string& pointer, const std::vector<float>& values, const std::string& type,
             const std::string& interpolation = "LINEAR") {
  const int input = file.accessor<float>({0, 2}, "SCALAR"), output = file.accessor<float>(values, type);
  if (!file.root.contains("animations"))
    file.root["animations"] = {{{"samplers", Json::array()}, {"channels", Json::array()}}};
  Json& clip = file.root["animations"][0];
  clip["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", interpolation}});
  clip["channels"].push_back(
      {{"sampler", clip["samplers"].size() - 1},
       {"target", {{"path", "pointer"}, {"extensions", {{"KHR_animation_pointer", {{"pointer", pointer}}}}}}}});
  file.root["extensionsUsed"] = {"KHR_animation_pointer"};
}

LoadOptions at(float time) {
  LoadOptions options = GltfFile::plainLight();
  options.frameTime = time;
  return options;
}

GltfFile redQuad() {
  GltfFile file = quadFile();
  const int texture = addTexture(file);
  giveMaterial(
      file,
      {{"pbrMetallicRoughness",
        {{"baseColorFactor", {1, 0, 0, 1}},
         {"baseColorTexture", {{"index", texture}, {"extensions", {{"KHR_texture_transform", Json::object()}}}}}}},
       {"extensions", {{"KHR_materials_transmission", Json::object()}}}});
  return file;
}

}  // namespace

TEST_CASE("gltf: pointers move factors of materials, of extensions too") {
  GltfFile file = redQuad();
  animate(file, "/materials/0/pbrMetallicRoughness/baseColorFactor", {1, 0, 0, 1, 0, 1, 0, 0.5f}, "VEC4");
  animate(file, "/materials/0/pbrMetallicRoughness/roughnessFactor", {0, 1}, "SCALAR");
  animate(file, "/materials/0/extensions/KHR_materials_transmission/transmissionFactor", {0, 0.5f}, "SCALAR");
  animate(file, "/materials/0/emissiveFactor", {0, 0, 0, 1, 2, 3}, "VEC3", "STEP");
  const Material half = file.load(at(1)).materials[0];
  CHECK(half.baseColor == Spectrum(0.5f, 0.5f, 0));
  CHECK(half.alpha == 0.75f);
  CHECK(half.roughness == 0.5f);
  CHECK(half.transmission == 0.25f);
  CHECK(half.emission == Spectrum(0));
  CHECK(half.baseColorTexture);
  const SceneData end = file.load(at(5));
  CHECK(end.materials[0].baseColor == Spectrum(0, 1, 0));
  CHECK(end.materials[0].emission == Spectrum(1, 2, 3));
  CHECK_FALSE(hasWarning(end, "/animations"));
  // Without a time, everything is at rest.
  const Material rest = file.load().materials[0];
  CHECK(rest.baseColor == Spectrum(1, 0, 0));
  CHECK(rest.roughness == 1);
}

TEST_CASE("gltf: values of another shape than what their pointer leads to are told, and move nothing") {
  GltfFile file = redQuad();
  animate(file, "/materials/0/emissiveFactor", {1, 1, 1, 1, 0, 0, 0, 0}, "VEC4");
  animate(file, "/materials/0/pbrMetallicRoughness/roughnessFactor", {0, 1}, "SCALAR");
  const SceneData half = file.load(at(1));
  CHECK(half.materials[0].emission == Spectrum(0));
  CHECK(half.materials[0].roughness == 0.5f);
  CHECK(hasWarning(half, "/animations/0/channels/0"));
}

TEST_CASE("gltf: pointers move the transforms of textures") {
  GltfFile file = redQuad();
  const std::string transform = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/";
  animate(file, transform + "offset", {0, 0, 1, 0.5f}, "VEC2");
  animate(file, transform + "scale", {1, 1, 3, 1}, "VEC2");
  GltfFile twin = redQuad();
  twin.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.5, 0.25}}, {"scale", {2, 1}}};
  CHECK(file.load(at(1)).materials[0].baseColorTexture.matrix == twin.load().materials[0].baseColorTexture.matrix);
}

TEST_CASE("gltf: pointers move lights, lenses, places and visibility") {
  GltfFile file = quadFile();
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 1}}};
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}}};
  file.append("nodes", {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  file.append("nodes", {{"camera", 0}});
  file.append("nodes", {{"mesh", 0}});
  file.root["scenes"][0]["nodes"] = {0, 1, 2, 3};
  animate(file, "/extensions/KHR_lights_punctual/lights/0/intensity", {0, 4}, "SCALAR");
  animate(file, "/extensions/KHR_lights_punctual/lights/0/color", {1, 1, 1, 0, 1, 1}, "VEC3");
  animate(file, "/cameras/0/perspective/yfov", {0.5f, 1}, "SCALAR");
  animate(file, "/nodes/1/translation", {0, 0, 0, 2, 0, 0}, "VEC3");
  animate(file, "/nodes/3/extensions/KHR_node_visibility/visible", {0, 1}, "SCALAR", "STEP");
  const SceneData half = file.load(at(1));
  CHECK(half.lights[0].intensity == Spectrum(1, 2, 2));
  CHECK(half.cameras[0].yfov == 0.75f);
  CHECK(Vec3(half.origin) + half.lights[0].position == Vec3(1, 0, 0));
  CHECK(half.instances.size() == 1);
  const SceneData end = file.load(at(2));
  CHECK(end.lights[0].intensity == Spectrum(0, 4, 4));
  CHECK(end.instances.size() == 2);
  CHECK(file.load().instances.size() == 2);
}

TEST_CASE("gltf: a pointer moves the weights of a mesh where nodes have none of their own") {
  GltfFile file = quadFile();
  const int target = file.accessor<float>({0, 0, 2, 0, 0, 2, 0, 0, 2, 0, 0, 2}, "VEC3");
  file.primitive()["targets"] = {{{"POSITION", target}}};
  file.root["nodes"] = {{{"mesh", 0}}, {{"mesh", 0}, {"weights", {1}}}, {{"mesh", 0}}};
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  animate(file, "/meshes/0/weights", {0, 1}, "SCALAR");
  const SceneData half = file.load(at(1));
  std::vector<float> heights;
  for (const MeshInstance& i : half.instances) heights.push_back(half.meshes[i.mesh].positions[0].z);
  CHECK(heights == std::vector<float>{1, 2, 1});
  CHECK_FALSE(hasWarning(half, "/animations"));
  CHECK(file.load().meshes[0].positions[0].z == 0);
  file.root["nodes"][0]["weights"] = file.root["nodes"][2]["weights"] = {0};
  CHECK(hasWarning(file.load(at(1)), "leads to nothing that braid can animate"));
}

TEST_CASE("gltf: a file that is posed again has no trace of the time before") {
  GltfFile file = redQuad();
  animate(file, "/materials/0/pbrMetallicRoughness/baseColorFactor", {1, 0, 0, 1, 0, 1, 0, 1}, "VEC4");
  const Folder folder;
  SceneFile scene(folder.write("scene.glb", file.glb()), at(0));
  CHECK(scene.pose(2.0f).materials[0].baseColor == Spectrum(0, 1, 0));
  CHECK(scene.pose(0.0f).materials[0].baseColor == Spectrum(1, 0, 0));
  CHECK(scene.pose(1.0f).materials[0].baseColor == Spectrum(0.5f, 0.5f, 0));
  CHECK(scene.pose({}).materials[0].baseColor == Spectrum(1, 0, 0));
}

TEST_CASE("gltf: while the shutter is open, properties are as at its middle, which is told once") {
  GltfFile file = redQuad();
  animate(file, "/materials/0/pbrMetallicRoughness/baseColorFactor", {1, 0, 0, 1, 0, 1, 0, 1}, "VEC4");
  animate(file, "/materials/0/pbrMetallicRoughness/metallicFactor", {0, 1}, "SCALAR");
  LoadOptions options = at(0);
  options.shutter = 1;
  const SceneData scene = file.load(options);
  CHECK(scene.materials[0].baseColor == Spectrum(0.75f, 0.25f, 0));
  size_t told = 0;
  for (const std::string& line : scene.warnings) told += line.find("do not blur") != std::string::npos ? 1 : 0;
  CHECK(told == 1);
}

TEST_CASE("gltf: values of pointers are brought into their range, and those that lead nowhere are told") {
  GltfFile file = redQuad();
  animate(file, "/materials/0/pbrMetallicRoughness/roughnessFactor", {-3, 7}, "SCALAR");
  CHECK(file.load(at(0)).materials[0].roughness == 0);
  CHECK(file.load(at(2)).materials[0].roughness == 1);
  for (const char* pointer :
       {"", "/", "materials/0/emissiveFactor", "/materials/1/emissiveFactor", "/materials/00/emissiveFactor",
        "/materials/-1/emissiveFactor", "/materials/0/name", "/materials/0/emissiveFactor/0", "/nodes/7/translation",
        "/nodes/0/mesh", "/materials/0/extensions/KHR_materials_sheen/sheenRoughnessFactor", "/materials/0~2/x",
        "/materials/99999999999999/emissiveFactor", "/buffers/0/byteLength", "/nodes/0/weights", "/meshes/0/weights",
        "/meshes/7/weights"}) {
    CAPTURE(std::string(pointer));
    GltfFile wrong = redQuad();
    animate(wrong, pointer, {0, 1}, "SCALAR");
    const SceneData scene = wrong.load(at(1));
    CHECK(hasWarning(scene, "leads to nothing that braid can animate"));
    CHECK(scene.materials[0].baseColor == Spectrum(1, 0, 0));
  }
  // Too few values.
  GltfFile few = redQuad();
  animate(few, "/materials/0/emissiveFactor", {0, 1}, "SCALAR");
  CHECK(few.load(at(1)).materials[0].emission == Spectrum(0));
}

}  // namespace braid::test_gltf_pointers
