// SPDX-License-Identifier: Apache-2.0
// A flaw costs only the thing that it is in: the rest is loaded, and one warning a kind says what was left out. Flaws
// of what the picture does not use are notes. With `strict` every file of this test is refused.
#include "renderer/scene/data/closed_mesh.h"
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

#include <limits>

namespace braid::test_gltf_lenient {

using namespace test;
using namespace test::gltf_lenient;

namespace {

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

}  // namespace

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
  // Of an image that is found so, nothing else is told.
  GltfFile textured = quadFile();
  textured.root["images"] = {{{"uri", "brick.png"}}};
  textured.root["textures"] = {{{"source", 0}}};
  giveMaterial(textured, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  folder.write("Brick.PNG", {tinyPng().begin(), tinyPng().end()});
  const SceneData named = loadGltf(folder.write("textured.glb", textured.glb()));
  CHECK(hasWarning(named, "names 'brick.png', but the file is 'Brick.PNG'"));
  CHECK_FALSE(hasWarning(named, "does not exist"));
  CHECK(named.textures.size() == 1);
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
}

TEST_CASE("lenient: numbers beyond a float") {
  GltfFile file = triangleFile();
  file.root["nodes"].push_back({{"mesh", 0}, {"translation", {1e39, 0, 0}}});
  file.root["scenes"][0]["nodes"] = {0, 1};
  const SceneData scene = loadWarned(file, "/nodes/1/translation/0: is 1e+39, too large for a 32-bit float");
  CHECK(scene.instances.size() == 1);
}

TEST_CASE("lenient: a solid whose faces look inward is turned outward") {
  for (const bool inward : {false, true}) {
    GltfFile file = triangleFile();
    const int position = file.accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3");
    const std::vector<uint16_t> outward = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    const int indices =
        file.accessor<uint16_t>(inward ? std::vector<uint16_t>(outward.rbegin(), outward.rend()) : outward, "SCALAR");
    file.root["materials"] = {{{"extensions",
                                {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                                 {"KHR_materials_volume", {{"thicknessFactor", 1}}}}}}};
    file.root["meshes"][0]["primitives"][0] = {
        {"attributes", {{"POSITION", position}}}, {"indices", indices}, {"material", 0}};
    const SceneData scene = file.load();
    CHECK(isClosedOutward(scene.meshes[0]));
    CHECK(hasWarning(scene, "/meshes: a closed mesh with a volume") == inward);
    CHECK(errorOf(file).empty() != inward);
  }
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
