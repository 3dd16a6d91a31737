// SPDX-License-Identifier: Apache-2.0
// Textures, samplers and materials of a flawed file: what cannot be had is as if absent, with one warning a kind.
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/gltf_fixture.h"

#include <cmath>

namespace braid::test_gltf_lenient_materials {

using namespace test;
using namespace test::gltf_lenient;

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

TEST_CASE("lenient: media that scatter where they can, and say where they cannot") {
  GltfFile file = quadFile();
  const int texture = addTexture(file);
  const auto scene = [&](const Json& scatter, const Json& volume) {
    GltfFile one = file;
    giveMaterial(one, {{"extensions",
                        {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                         {"KHR_materials_volume", volume},
                         {"KHR_materials_volume_scatter", scatter}}}});
    return one.load();
  };
  const Json volume = {{"thicknessFactor", 1}, {"attenuationColor", {0.5, 0.5, 0.5}}, {"attenuationDistance", 1}};
  const std::string at = "/materials/0/extensions/KHR_materials_volume_scatter";
  const SceneData sheet = scene({{"multiscatterColorFactor", {2, 0.5, 0.5}}, {"scatterAnisotropy", 1}}, volume);
  CHECK(hasWarning(sheet, at + "/multiscatterColorFactor"));
  CHECK(hasWarning(sheet, at + "/scatterAnisotropy: is not between -1 and 1"));
  CHECK(hasWarning(sheet, "is not closed by itself"));
  CHECK(sheet.materials.at(0).scatterAnisotropy == 0.9999f);
  CHECK(sheet.materials.at(0).scatterAlbedo.x == 1);
  CHECK(scene({{"multiscatterColorFactor", {1, 1, 1}}, {"scatterAnisotropy", -3}}, volume)
            .materials.at(0)
            .scatterAnisotropy == -0.9999f);
  CHECK(hasWarning(scene({{"multiscatterColorTexture", {{"index", texture}}}}, volume),
                   at + "/multiscatterColorTexture: is not read"));
  const Json color = {{"multiscatterColorFactor", {0.5, 0.5, 0.5}}};
  for (const Json& nothing : {Json::object(), Json{{"thicknessFactor", 0}, {"attenuationColor", {0.5, 0.5, 0.5}}},
                              Json{{"thicknessFactor", 1}}}) {
    const SceneData none = scene(color, nothing);
    CHECK(hasWarning(none, at + ": scattering needs transmission"));
    CHECK_FALSE(none.materials.at(0).scatters());
    CHECK_FALSE(hasWarning(none, "is not closed"));
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

}  // namespace braid::test_gltf_lenient_materials
