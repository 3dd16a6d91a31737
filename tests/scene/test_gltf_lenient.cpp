// SPDX-License-Identifier: Apache-2.0
// A flaw costs only the thing that it is in: the rest is loaded, and one warning a kind says what was left out. Flaws
// of what the picture does not use are notes. With `strict` every file of this test is refused.
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

#include <cmath>
#include <limits>

namespace braid::test_gltf_lenient {

using namespace test;

namespace {

bool hasNote(const SceneData& scene, const std::string& part) {
  for (const std::string& note : scene.notes) {
    if (contains(note, part)) return true;
  }
  return false;
}

// Loads, checks the warning, and that --strict refuses the same file.
SceneData loadWarned(const GltfFile& file, const std::string& warning, LoadOptions options = {}) {
  const SceneData scene = file.load(options);
  std::string all;
  for (const std::string& line : scene.warnings) all += line + '\n';
  INFO("warnings: ", all);
  CHECK(hasWarning(scene, warning));
  CHECK(!errorOf(file, options).empty());
  return scene;
}

SceneData loadNoted(const GltfFile& file, const std::string& note) {
  const SceneData scene = file.load();
  std::string all;
  for (const std::string& line : scene.notes) all += line + '\n';
  INFO("notes: ", all);
  CHECK(hasNote(scene, note));
  CHECK_FALSE(hasWarning(scene, note));
  CHECK(scene.meshes.size() == 1);
  CHECK(!errorOf(file).empty());
  return scene;
}

// A second triangle beside the first one, each a primitive of its own.
GltfFile twoTriangles() {
  GltfFile file = triangleFile();
  const int position = file.accessor<float>({5, 0, 0, 6, 0, 0, 5, 1, 0}, "VEC3");
  file.root["meshes"][0]["primitives"].push_back({{"attributes", {{"POSITION", position}}}});
  return file;
}

float x(const SceneData& scene) { return scene.meshes.at(0).positions.at(0).x; }

}  // namespace

TEST_CASE("lenient: a texture that cannot be had leaves its factor alone") {
  GltfFile file = quadFile();
  const int texture = addTexture(file), second = addTexture(file);
  giveMaterial(file, {{"pbrMetallicRoughness",
                       {{"baseColorFactor", {0, 0.5, 0, 1}},
                        {"baseColorTexture", {{"index", texture}}},
                        {"metallicRoughnessTexture", {{"index", second}}}}}});
  std::string warning;
  SUBCASE("a missing file") {
    file.root["images"][0] = {{"uri", "leaf.png"}};
    warning = "/images/0: file 'leaf.png' does not exist; put it beside the scene or correct the uri; meanwhile";
  }
  SUBCASE("a broken file") {
    file.root["bufferViews"][static_cast<size_t>(file.root["images"][0]["bufferView"])]["byteLength"] = 50;
    warning = "/images/0: ";
  }
  SUBCASE("no source") {
    file.root["images"][0] = {{"name", "leaf"}};
    warning = "/images/0: has neither uri nor bufferView";
  }
  SUBCASE("another host") {
    file.root["images"][0] = {{"uri", "http://example.com/leaf.png"}};
    warning = "/images/0: 'http://example.com/leaf.png' is not relative";
  }
  SUBCASE("no such texture") {
    file.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 7;
    warning = "/materials/0/pbrMetallicRoughness/baseColorTexture/index: is 7, but textures end at 1";
  }
  const SceneData scene = loadWarned(file, warning);
  REQUIRE(scene.materials.size() == 1);
  CHECK_FALSE(scene.materials[0].baseColorTexture);
  CHECK(scene.materials[0].baseColor == Spectrum(0, 0.5f, 0));
  REQUIRE(scene.materials[0].metallicRoughnessTexture);
  CHECK(scene.textures.size() == 1);
  CHECK(scene.textures[0].sharedImage());
}

TEST_CASE("lenient: many flaws of a kind are one warning with their number") {
  GltfFile file = quadFile();
  Json material;
  for (int i = 0; i < 3; ++i) {
    file.append("images", {{"uri", "leaf" + std::to_string(i) + ".png"}});
    file.append("textures", {{"source", i}});
  }
  giveMaterial(file, {{"normalTexture", {{"index", 0}}},
                      {"emissiveTexture", {{"index", 1}}},
                      {"emissiveFactor", {1, 1, 1}},
                      {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 2}}}}}});
  const SceneData scene = loadWarned(file, "/images/0: file 'leaf0.png' does not exist");
  CHECK(hasWarning(scene, "(3 times)"));
  CHECK_FALSE(hasWarning(scene, "leaf1.png"));
}

TEST_CASE("lenient: what the picture does not use is noted only") {
  GltfFile file = triangleFile();
  SUBCASE("camera") {
    file.root["nodes"].push_back({{"camera", 0}});
    file.root["scenes"][0]["nodes"] = {0, 1};
    file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 1}}}},
                            {{"type", "perspective"}, {"perspective", {{"yfov", 45}, {"znear", 1}}}}};
    loadNoted(file, "/cameras/1/perspective/yfov: is at least pi");
  }
  SUBCASE("material") {
    file.root["materials"] = {{{"alphaMode", "CUTOUT"}}};
    loadNoted(file, "/materials/0/alphaMode: is 'CUTOUT'; it must be one of OPAQUE, MASK, BLEND");
  }
  SUBCASE("mesh") {
    const int position = file.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
    const int indices = file.accessor<uint16_t>({0, 1, 9}, "SCALAR");
    file.append("meshes", {{"primitives", {{{"attributes", {{"POSITION", position}}}, {"indices", indices}}}}});
    loadNoted(file, "/meshes/1/primitives/0/indices: accessor 2 holds the index 9");
  }
  SUBCASE("image") {
    file.root["images"] = {{{"name", "x"}}};
    loadNoted(file, "/images/0: has neither uri nor bufferView");
  }
  SUBCASE("animation") {
    const int input = file.accessor<float>({0, 1, 2}, "SCALAR"), output = file.accessor<float>({0, 0, 0}, "VEC3");
    file.root["animations"] = {{{"samplers", {{{"input", input}, {"output", output}}}},
                                {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}}}};
    loadNoted(file, "/animations/0/channels/0/sampler: has 1 value for 3 key times");
    LoadOptions options;
    options.frameTime = 1.0f;
    CHECK(hasWarning(file.load(options), "/animations/0/channels/0/sampler: has 1 value"));
  }
  SUBCASE("light, skin, node and accessor") {
    file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"range", -1}}};
    file.append("skins", {{"joints", Json::array()}});
    file.append("nodes", {{"mesh", 9}});
    file.append("accessors", {{"componentType", 77}, {"count", 3}, {"type", "SCALAR"}});
    const SceneData scene = loadNoted(file, "/extensions/KHR_lights_punctual/lights/0/range: is not positive");
    CHECK(hasNote(scene, "/skins/0/joints: is empty"));
    CHECK(hasNote(scene, "/nodes/1/mesh: is 9"));
    CHECK(hasNote(scene, "/accessors/1/componentType: is 77"));
  }
}

TEST_CASE("lenient: the camera that looks is the one whose flaws matter") {
  GltfFile file = triangleFile();
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 1}}}},
                          {{"type", "perspective"}, {"perspective", {{"yfov", -1}, {"znear", 0}}}}};
  file.append("nodes", {{"camera", 0}});
  file.append("nodes", {{"camera", 1}, {"name", "eye"}});
  file.root["scenes"][0]["nodes"] = {0, 1, 2};
  CHECK(hasNote(file.load(), "/cameras/1/perspective/yfov: is not positive"));
  LoadOptions options;
  options.camera = "eye";
  const SceneData scene = file.load(options);
  CHECK(hasWarning(scene, "/cameras/1/perspective/yfov: is not positive"));
  REQUIRE(scene.cameras.size() == 2);
  CHECK(scene.cameras[1].yfov > 0);
}

TEST_CASE("lenient: a primitive that cannot be read is skipped, others are drawn") {
  GltfFile file = twoTriangles();
  Json& accessor = file.root["accessors"][0];
  std::string warning;
  SUBCASE("count beyond the view") {
    accessor["count"] = 4;
    warning = "/accessors/0: needs 4 elements";
  }
  SUBCASE("no such view") {
    accessor["bufferView"] = 9;
    warning = "/accessors/0/bufferView: is 9, but bufferViews end at 1";
  }
  SUBCASE("no type") {
    accessor.erase("type");
    warning = "/accessors/0/type: is missing";
  }
  SUBCASE("another shape") {
    accessor["type"] = "VEC2";
    warning = "/meshes/0/primitives/0/attributes/POSITION: accessor 0 has the wrong type";
  }
  SUBCASE("no such accessor") {
    file.primitive()["attributes"]["POSITION"] = 7;
    warning = "/meshes/0/primitives/0/attributes/POSITION: is 7, but accessors end at 1";
  }
  SUBCASE("unknown mode") {
    file.primitive()["mode"] = 7;
    warning = "/meshes/0/primitives/0/mode: is 7";
  }
  SUBCASE("indices that are no indices") {
    file.primitive()["indices"] = file.accessor<float>({0, 1, 2}, "SCALAR");
    warning = "/meshes/0/primitives/0/indices: accessor 2 has the wrong type";
  }
  SUBCASE("indices out of bounds") {
    file.primitive()["indices"] = 9;
    warning = "/meshes/0/primitives/0/indices: is 9, but accessors end at 1";
  }
  SUBCASE("sparse indices out of order") {
    const int indices = file.view<uint8_t>({2, 1}), values = file.view<float>({0, 0, 0, 0, 0, 0});
    file.root["accessors"][0]["sparse"] = {{"count", 2},
                                           {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                           {"values", {{"bufferView", values}}}};
    warning = "/accessors/0/sparse/indices: must increase";
  }
  SUBCASE("a sparse accessor that is none") {
    accessor["sparse"] = "yes";
    warning = "/accessors/0/sparse: is the text 'yes'; it must be an object";
  }
  const SceneData scene = loadWarned(file, warning);
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 5);
}

TEST_CASE("lenient: a truncated buffer keeps what lies inside") {
  GltfFile file = twoTriangles();
  file.root["buffers"] = {{{"byteLength", file.binary.size()}}};
  file.root["bufferViews"][0]["byteLength"] = file.binary.size();
  file.root["accessors"][1]["bufferView"] = 0;
  file.root["accessors"][1]["byteOffset"] = 36;
  file.binary.resize(40);
  const SceneData scene = loadWarned(file, "/buffers/0/byteLength: is 72, but the data has 40 bytes: it is truncated");
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 0);
  CHECK(hasWarning(scene, "/accessors/1: needs 3 elements"));
}

TEST_CASE("lenient: a GLB that is cut keeps what is there") {
  const GltfFile file = twoTriangles();
  const std::string whole = file.glb();
  const Folder folder;
  const SceneData scene = loadGltf(folder.write("a.glb", whole.substr(0, whole.size() - 20)));
  CHECK(hasWarning(scene, "is truncated: its header says"));
  REQUIRE(scene.meshes.size() == 1);
  CHECK(x(scene) == 0);
}

TEST_CASE("lenient: nothing left to render is refused, with every reason") {
  GltfFile file = triangleFile();
  SUBCASE("no data") {
    file.root["buffers"] = {{{"uri", "missing.bin"}, {"byteLength", 36}}};
    CHECK(contains(errorOf([&] { file.load(); }), "/buffers/0/uri: file 'missing.bin' does not exist"));
  }
  SUBCASE("the only primitive is broken, something unused too") {
    file.root["accessors"][0]["count"] = 4;
    file.root["materials"] = {{{"alphaMode", "CUTOUT"}}};
    const std::string text = errorOf([&] { file.load(); });
    CHECK(contains(text, "/accessors/0: needs 4 elements"));
    CHECK_FALSE(contains(text, "CUTOUT"));
  }
  SUBCASE("a GLB cut within its JSON") {
    const Folder folder;
    const std::string path = folder.write("a.glb", file.glb().substr(0, 60));
    CHECK(contains(errorOf([&] { loadGltf(path); }), "is truncated"));
  }
  SUBCASE("no JSON") {
    const Folder folder;
    const std::string path = folder.write("a.gltf", R"({"asset": {"version": "2.0"},})");
    CHECK(contains(errorOf([&] { loadGltf(path); }), "neither GLB nor valid JSON"));
  }
  SUBCASE("another version") {
    file.root["asset"]["version"] = "1.0";
    CHECK(contains(errorOf([&] { file.load(); }), "/asset/version: is '1.0'"));
  }
}

TEST_CASE("lenient: attributes that cannot be read are as if absent") {
  GltfFile file = quadFile();
  Json& attributes = file.primitive()["attributes"];
  std::string warning;
  SUBCASE("too few") {
    attributes["NORMAL"] = file.accessor<float>({0, 0, 1}, "VEC3");
    warning = "/meshes/0/primitives/0/attributes/NORMAL: accessor 4 has 1 element, but POSITION has 4";
  }
  SUBCASE("out of bounds") {
    file.root["accessors"][1]["byteOffset"] = 4;
    warning = "/accessors/1: needs 4 elements";
  }
  const SceneData scene = loadWarned(file, warning);
  REQUIRE(scene.meshes.size() == 1);
  CHECK(scene.meshes[0].normals.empty());
  CHECK(scene.meshes[0].triangles.size() == 2);
}

TEST_CASE("lenient: triangles of vertices that do not exist are dropped, others stay") {
  GltfFile file = quadFile();
  file.primitive()["indices"] = file.accessor<uint16_t>({0, 1, 2, 0, 2, 4}, "SCALAR");
  const SceneData scene = loadWarned(file, "holds the index 4, but there are 4 vertices");
  CHECK(scene.meshes.at(0).triangles.size() == 1);
}

TEST_CASE("lenient: materials keep what can be read of them") {
  GltfFile file = quadFile();
  const auto material = [&](const Json& json, const std::string& warning) {
    GltfFile one = file;
    giveMaterial(one, json);
    return loadWarned(one, warning).materials.at(0);
  };
  CHECK(material("red", "/materials/0: is the text 'red'; it must be an object").baseColor == Spectrum(1));
  const Material mixed = material(
      {{"alphaMode", "CUTOUT"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, "x", 1}}, {"metallicFactor", 0}}}},
      "/materials/0/alphaMode: is 'CUTOUT'");
  CHECK(mixed.alphaMode == AlphaMode::Opaque);
  CHECK(mixed.metallic == 0);
  CHECK(mixed.baseColor == Spectrum(1));
  const auto volume = [](const Json& distance) {
    return Json{
        {"extensions", {{"KHR_materials_volume", {{"thicknessFactor", 1}, {"attenuationDistance", distance}}}}}};
  };
  const std::string at = "/materials/0/extensions/KHR_materials_volume/attenuationDistance: is ";
  CHECK(std::isinf(material(volume(nullptr), at + "null; it must be a number; meanwhile it is taken as absent")
                       .attenuationDistance));
  CHECK(std::isinf(material(volume(1.797e308), at + "1.797e+308, too large").attenuationDistance));
  GltfFile none = file;
  none.primitive()["material"] = 3;
  CHECK(loadWarned(none, "/meshes/0/primitives/0/material: is 3").materials.at(0).name == "default");
}

TEST_CASE("lenient: lights") {
  GltfFile file = triangleFile();
  file.node()["extensions"]["KHR_lights_punctual"]["light"] = 0;
  const auto light = [&](const Json& json, const std::string& warning) {
    file.root["extensions"]["KHR_lights_punctual"]["lights"] = {json};
    return loadWarned(file, "/extensions/KHR_lights_punctual/lights/0" + warning).lights.at(0);
  };
  CHECK(std::isinf(light({{"type", "point"}, {"range", 1.797e308}}, "/range: is 1.797e+308, too large").range));
  CHECK(std::isinf(light({{"type", "point"}, {"range", 0}}, "/range: is not positive").range));
  CHECK(light({{"type", "lamp"}}, "/type: is 'lamp'").kind == PunctualKind::Point);
  CHECK(light({{"type", "spot"}}, "/spot: is missing").kind == PunctualKind::Spot);
  CHECK(light({{"type", "point"}, {"intensity", 3e38}, {"color", {9, 1, 1}}}, "/intensity: times color").intensity.x ==
        std::numeric_limits<float>::max());
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = Json::array();
  CHECK(loadWarned(file, "/nodes/0/extensions/KHR_lights_punctual/light: is 0, but the file has no lights")
            .lights.empty());
}

TEST_CASE("lenient: matrices") {
  GltfFile file = triangleFile();
  Json matrix = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1};
  SUBCASE("rounding in the last row is no flaw at all") {
    matrix[15] = 0.99999994;
    matrix[3] = 1e-9;
    file.node()["matrix"] = matrix;
    const SceneData scene = file.load();
    CHECK(scene.instances.at(0).toWorld[3] == Vec4(7, 0, 0, 1));
    CHECK(scene.instances.at(0).toWorld[0] == Vec4(1, 0, 0, 0));
    CHECK_FALSE(hasWarning(scene, "affine"));
    CHECK(errorOf(file).empty());
  }
  SUBCASE("a projection loses its last row") {
    matrix[3] = 1;
    file.node()["matrix"] = matrix;
    CHECK(loadWarned(file, "/nodes/0/matrix: is not affine").instances.at(0).toWorld[3] == Vec4(7, 0, 0, 1));
  }
  SUBCASE("one that is none is absent") {
    file.node()["matrix"] = {1, 2, 3};
    CHECK(loadWarned(file, "/nodes/0/matrix: is 3 entries").instances.at(0).toWorld == Mat4(1));
  }
}

TEST_CASE("lenient: nodes that form no tree") {
  GltfFile file = triangleFile();
  SUBCASE("a cycle is cut") {
    file.root["nodes"] = {{{"children", {1}}}, {{"children", {0, 2}}}, {{"mesh", 0}}};
    CHECK(loadWarned(file, "leads back to node").instances.size() == 1);
  }
  SUBCASE("its own child") {
    file.root["nodes"] = {{{"children", {0}}, {"mesh", 0}}};
    CHECK(loadWarned(file, "/nodes/0/children: leads back to node 0").instances.size() == 1);
  }
  SUBCASE("of two parents the first has it") {
    file.root["nodes"] = {{{"children", {1, 2}}, {"translation", {1, 0, 0}}},
                          {{"children", {2}}, {"translation", {5, 0, 0}}},
                          {{"mesh", 0}}};
    const SceneData scene = loadWarned(file, "/nodes/1/children: names node 2, already a child of node 0");
    REQUIRE(scene.instances.size() == 1);
    CHECK(scene.instances[0].toWorld[3].x == 1);
  }
  SUBCASE("children and meshes that do not exist") {
    file.root["nodes"] = {{{"children", {1, 9, 2}}}, {{"mesh", 0}}, {{"mesh", 9}}};
    const SceneData scene = loadWarned(file, "/nodes/0/children/1: is 9, but nodes end at 2");
    CHECK(hasWarning(scene, "/nodes/2/mesh: is 9"));
    CHECK(scene.instances.size() == 1);
  }
  SUBCASE("the scene does not exist") {
    file.root["scene"] = 4;
    CHECK(loadWarned(file, "/scene: is 4, but scenes end at 0").instances.size() == 1);
  }
}

TEST_CASE("lenient: animations") {
  GltfFile file = triangleFile();
  LoadOptions options;
  options.frameTime = 1.5f;
  const auto addChannel = [&](const std::vector<float>& times, const std::vector<float>& values, const char* path) {
    const int input = file.accessor(times, "SCALAR"), output = file.accessor(values, "VEC3");
    Json& clip = file.root["animations"][0];
    clip["samplers"].push_back({{"input", input}, {"output", output}});
    clip["channels"].push_back({{"sampler", clip["samplers"].size() - 1}, {"target", {{"node", 0}, {"path", path}}}});
  };
  SUBCASE("two keys at one time are a jump") {
    addChannel({0, 1, 1, 2}, {0, 0, 0, 1, 0, 0, 5, 0, 0, 7, 0, 0}, "translation");
    const auto at = [&](float time) {
      options.frameTime = time;
      return file.load(options).instances.at(0).toWorld[3].x;
    };
    CHECK(at(0.5f) == 0.5f);
    CHECK(at(1) == 5);
    CHECK(at(1.5f) == 6);
    CHECK(hasWarning(file.load(options), "two keys at one time"));
  }
  SUBCASE("a channel that cannot be read leaves the others") {
    addChannel({0, 1, 2}, {0, 0, 0}, "scale");
    addChannel({0, 2}, {0, 0, 0, 4, 0, 0}, "translation");
    addChannel({0, 2}, {0, 0, 0, 4, 0, 0}, "colour");
    Json& clip = file.root["animations"][0];
    clip["channels"].push_back({{"sampler", 9}, {"target", {{"node", 0}, {"path", "scale"}}}});
    clip["channels"].push_back({{"target", 3}});
    clip["samplers"].push_back({{"input", 77}});
    const SceneData scene = loadWarned(file, "/animations/0/channels/0/sampler: has 1 value", options);
    CHECK(scene.instances.at(0).toWorld[3].x == 3);
    CHECK(hasWarning(scene, "/animations/0/channels/2/target/path: is 'colour'"));
    CHECK(hasWarning(scene, "/animations/0/channels/3/sampler: is 9"));
    CHECK(hasWarning(scene, "/animations/0/samplers/3/input: is 77"));
  }
}

TEST_CASE("lenient: skins") {
  GltfFile file = triangleFile();
  Json& attributes = file.primitive()["attributes"];
  attributes["WEIGHTS_0"] = file.accessor<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  file.root["nodes"] = {{{"mesh", 0}, {"skin", 0}}, {{"translation", {3, 0, 0}}}};
  file.root["scenes"][0]["nodes"] = {0, 1};
  file.root["skins"] = {{{"joints", {1}}}};
  const std::vector<uint8_t> bytes(12, 0);
  attributes["JOINTS_0"] = file.accessor(bytes, "VEC4");
  SUBCASE("32-bit joints are read") {
    attributes["JOINTS_0"] = file.accessor(std::vector<uint32_t>(12, 0), "VEC4");
    CHECK(x(loadWarned(file, "/attributes/JOINTS_0: accessor 3 has the wrong type")) == 3);
  }
  SUBCASE("missing bind matrices are the identity") {
    file.root["skins"][0]["joints"] = {1, 1};
    file.root["skins"][0]["inverseBindMatrices"] =
        file.accessor<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1}, "MAT4");
    CHECK(x(loadWarned(file, "/skins/0/inverseBindMatrices: has 1 matrix for 2 joints")) == 4);
  }
  SUBCASE("no joints") {
    file.root["skins"][0]["joints"] = Json::array();
    CHECK(x(loadWarned(file, "/skins/0/joints: is empty")) == 0);
  }
  SUBCASE("a joint that does not exist moves nothing, others keep their numbers") {
    file.root["skins"][0]["joints"] = {9, 1};
    attributes["JOINTS_0"] = file.accessor<uint8_t>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
    CHECK(x(loadWarned(file, "/skins/0/joints/0: is 9, but nodes end at 1")) == 3);
  }
}

TEST_CASE("lenient: samplers, and sets of texture coordinates") {
  GltfFile file = quadFile();
  SUBCASE("unknown wrap modes repeat") {
    giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", addTexture(file)}}}}}});
    file.root["samplers"] = {{{"wrapS", 5}}};
    file.root["textures"][0]["sampler"] = 0;
    CHECK(loadWarned(file, "/samplers/0/wrapS: is 5").textures.size() == 1);
    file.root["textures"][0]["sampler"] = 3;
    CHECK(loadWarned(file, "/textures/0/sampler: is 3").textures.size() == 1);
  }
  SUBCASE("four sets are read as they are named") {
    Json material = {{"emissiveFactor", {1, 1, 1}}};
    const char* const names[] = {"normalTexture", "emissiveTexture"};
    for (int i = 0; i < 2; ++i) material[names[i]] = {{"index", addTexture(file)}, {"texCoord", i}};
    material["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", addTexture(file)}, {"texCoord", 2}}},
                                        {"metallicRoughnessTexture", {{"index", addTexture(file)}, {"texCoord", 5}}}};
    for (const int set : {1, 2, 5}) {
      const auto value = static_cast<float>(set);
      file.primitive()["attributes"]["TEXCOORD_" + std::to_string(set)] =
          file.accessor(std::vector<float>(8, value), "VEC2");
    }
    giveMaterial(file, material);
    const SceneData scene = file.load();
    const Material& m = scene.materials.at(0);
    const auto first = [&](const TextureRef& ref) { return scene.meshes.at(0).uv[ref.uvSet].at(0).x; };
    CHECK(first(m.emissiveTexture) == 1);
    CHECK(first(m.baseColorTexture) == 2);
    CHECK(first(m.metallicRoughnessTexture) == 5);
    CHECK_FALSE(hasWarning(scene, "uv sets"));
  }
}

TEST_CASE("lenient: text that a strict parser refuses") {
  const GltfFile file = triangleFile();
  const Folder folder;
  const auto loads = [&](const std::string& text, const std::string& warning) {
    const std::string path =
        folder.write("a.glb", glbOf(chunk(kJsonChunk, text, ' ') + chunk(kBinaryChunk, file.binary, '\0')));
    const SceneData scene = loadGltf(path);
    CHECK(hasWarning(scene, warning));
    CHECK(scene.meshes.size() == 1);
    LoadOptions options;
    options.strict = true;
    CHECK(contains(errorOf([&] { loadGltf(path, options); }), warning));
    return scene;
  };
  Json root = file.root;
  root["buffers"] = {{{"byteLength", 36}}};
  root["materials"] = {{{"name", "@"}, {"emissiveFactor", {0.25, 0, 0}}}};
  root["meshes"][0]["primitives"][0]["material"] = 0;
  const std::string text = root.dump();
  const auto with = [&](const std::string& what, const std::string& by) {
    std::string copy = text;
    return copy.replace(copy.find(what), what.size(), by);
  };
  CHECK(loads(with("\"@\"", "\"caf\xE9\""), "bytes that are not UTF-8").materials.at(0).name == "caf\xEF\xBF\xBD");
  CHECK(loads(with("\"@\"", "\"a\tb\""), "control characters").materials.at(0).name == "a\tb");
  CHECK(loads(with("\"@\"", "\"a\\_b\""), "backslashes").materials.at(0).name == "a\\_b");
  CHECK(loads(with("\"@\"", "\"\\ud800\""), "not UTF-8").materials.at(0).name == "\xEF\xBF\xBD");
  CHECK(isBlack(loads(with("0.25", "NaN"), "NaN, Infinity").materials.at(0).emission));
  CHECK(loads(with("0.25", "1e999"), "beyond 1e308").materials.at(0).emission.x == std::numeric_limits<float>::max());
}

TEST_CASE("lenient: files whose names are spelled otherwise") {
  GltfFile file = triangleFile();
  file.root["buffers"] = {{{"byteLength", 36}, {"uri", "textures/Ma\xCC\x88hne.BIN"}}};
  const Folder folder;
  const std::string scene = folder.write("scene.gltf", file.root.dump());
  folder.write("Textures/m\xC3\xA4hne.bin", file.binary);
  const SceneData found = loadGltf(scene);
  CHECK(found.meshes.size() == 1);
  CHECK(hasWarning(found, "but the file is 'Textures/m\xC3\xA4hne.bin'; correct the uri"));
  // Two that could be meant are none.
  folder.write("Textures/M\xC3\xA4hne.bin", file.binary);
  CHECK(contains(errorOf([&] { loadGltf(scene); }), "does not exist"));
}

TEST_CASE("lenient: files outside of the folder need permission") {
  GltfFile file = triangleFile();
  const Folder folder;
  const std::string data = folder.write("data/a.bin", file.binary);
  LoadOptions trusting;
  trusting.allowExternal = true;
  for (const std::string& uri : {std::string("../data/a.bin"), data, "file://" + data}) {
    file.root["buffers"] = {{{"byteLength", 36}, {"uri", uri}}};
    const std::string scene = folder.write("scene/scene.gltf", file.root.dump());
    CHECK(loadGltf(scene, trusting).meshes.size() == 1);
    CHECK(!errorOf([&] { loadGltf(scene); }).empty());
  }
  file.root["buffers"] = {{{"byteLength", 36}, {"uri", "http://localhost/a.bin"}}};
  const std::string scene = folder.write("scene/scene.gltf", file.root.dump());
  CHECK(contains(errorOf([&] { loadGltf(scene, trusting); }), "is not relative"));
}

TEST_CASE("lenient: required extensions") {
  GltfFile file = triangleFile();
  const auto require = [&](const std::string& name) {
    file.root["extensionsUsed"] = file.root["extensionsRequired"] = {name};
  };
  for (const char* name : {"EXT_structural_metadata", "EXT_mesh_features", "CESIUM_primitive_outline", "MSFT_lod",
                           "KHR_xmp_json_ld", "KHR_interactivity", "KHR_animation_pointer"}) {
    require(name);
    const SceneData scene = file.load();
    CHECK(scene.meshes.size() == 1);
    CHECK_FALSE(hasWarning(scene, name));
    CHECK(errorOf(file).empty());
  }
  require("ACME_gizmo");
  CHECK(contains(errorOf([&] { file.load(); }, ExitCode::UnsupportedExtension), "--ignore-extension ACME_gizmo"));
  LoadOptions options;
  options.ignoredExtensions = {"ACME_other", "ACME_gizmo"};
  CHECK(hasWarning(file.load(options), "'ACME_gizmo' is required but ignored"));
  // Read but not rendered is never silent.
  require("KHR_materials_dispersion");
  CHECK(hasWarning(file.load(), "'KHR_materials_dispersion' is read but not rendered"));
  require("KHR_animation_pointer");
  options.frameTime = 1.0f;
  CHECK(hasWarning(file.load(options), "'KHR_animation_pointer' is read but not rendered"));
}

TEST_CASE("lenient: numbers beyond a float") {
  GltfFile file = triangleFile();
  file.root["nodes"].push_back({{"mesh", 0}, {"translation", {1e39, 0, 0}}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  const SceneData scene = loadWarned(file, "/nodes/1/translation/0: is 1e+39, too large for a 32-bit float");
  CHECK(scene.instances.size() == 1);
}

TEST_CASE("lenient: wrong JSON types everywhere cost a warning at most") {
  const GltfFile original = quadFile();
  const Json flat = original.root.flatten();
  for (const Json& wrong : {Json(nullptr), Json("text"), Json(-1), Json(1e300), Json::array({Json::object()}),
                            Json::object(), Json(true)}) {
    for (const auto& entry : flat.items()) {
      GltfFile file = original;
      file.root[Json::json_pointer(entry.key())] = wrong;
      CAPTURE(entry.key());
      CAPTURE(wrong.dump());
      try {
        const SceneData scene = file.load();
        CHECK(!scene.warnings.empty());
      } catch (const Error& error) {
        CHECK(error.code() == ExitCode::BadInput);
        // Only without positions, triangles, nodes or version 2 is nothing left.
        const std::string key = entry.key();
        CHECK((contains(key, "/accessors/0") || contains(key, "/accessors/3") || contains(key, "/bufferViews/0") ||
               contains(key, "/bufferViews/3") || contains(key, "POSITION") || contains(key, "/indices") ||
               contains(key, "/mesh") || contains(key, "/nodes") || contains(key, "/version")));
      }
    }
  }
}

}  // namespace braid::test_gltf_lenient
