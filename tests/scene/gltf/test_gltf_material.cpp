// SPDX-License-Identifier: Apache-2.0
// Materials and textures from glTF: factors, extensions, texture transforms, uv sets, variants.
#include "tests/support/gltf_fixture.h"

#include <cmath>

namespace braid::test_gltf_material {

using namespace test;

namespace {

Material loadMaterial(const Json& material) {
  GltfFile file = quadFile();
  giveMaterial(file, material);
  const SceneData scene = file.load();
  REQUIRE(scene.materials.size() == 1);
  return scene.materials[0];
}

Json withExtension(const char* name, const Json& value) { return {{"extensions", {{name, value}}}}; }

}  // namespace

TEST_CASE("gltf: metallic-roughness factors, alpha and emission") {
  const Material m = loadMaterial(
      {{"name", "m"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0.5}, {"roughnessFactor", 0.25}}},
       {"emissiveFactor", {1, 0.5, 0}},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.3},
       {"doubleSided", true},
       {"extensions",
        {{"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}, {"KHR_materials_unlit", Json::object()}}}});
  CHECK(m.name == "m");
  CHECK(m.baseColor == Spectrum(0.1f, 0.2f, 0.3f));
  CHECK(m.alpha == 0.4f);
  CHECK(m.metallic == 0.5f);
  CHECK(m.roughness == 0.25f);
  CHECK(m.emission == Spectrum(4, 2, 0));
  CHECK(m.alphaMode == AlphaMode::Mask);
  CHECK(m.alphaCutoff == 0.3f);
  CHECK(m.doubleSided);
  CHECK(m.unlit);
}

TEST_CASE("gltf: material extensions of light that passes through") {
  CHECK(loadMaterial(withExtension("KHR_materials_ior", {{"ior", 0}})).ior == 0);
  CHECK(loadMaterial(withExtension("KHR_materials_ior", {{"ior", 1.33}})).ior == 1.33f);
  CHECK(loadMaterial(withExtension("KHR_materials_dispersion", {{"dispersion", 0.2}})).dispersion == 0.2f);
  const Material glass =
      loadMaterial({{"extensions",
                     {{"KHR_materials_transmission", {{"transmissionFactor", 0.9}}},
                      {"KHR_materials_volume",
                       {{"thicknessFactor", 1}, {"attenuationColor", {0.5, 0.6, 0.7}}, {"attenuationDistance", 2}}}}}});
  CHECK(glass.transmission == 0.9f);
  CHECK(glass.hasVolume());
  CHECK(glass.attenuationColor == Spectrum(0.5f, 0.6f, 0.7f));
  CHECK(glass.attenuationDistance == 2);
  const Material sheet = loadMaterial(withExtension("KHR_materials_transmission", {{"transmissionFactor", 1}}));
  CHECK(sheet.thinWalled);
  CHECK(std::isinf(sheet.attenuationDistance));
  const Material leaf =
      loadMaterial(withExtension("KHR_materials_diffuse_transmission",
                                 {{"diffuseTransmissionFactor", 0.4}, {"diffuseTransmissionColorFactor", {0, 1, 0}}}));
  CHECK(leaf.diffuseTransmission == 0.4f);
  CHECK(leaf.diffuseTransmissionColor == Spectrum(0, 1, 0));
}

TEST_CASE("gltf: a colour after many events becomes the albedo of one") {
  const auto solid = [](const Json& scatter) {
    return loadMaterial(
        {{"extensions",
          {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
           {"KHR_materials_volume",
            {{"thicknessFactor", 1}, {"attenuationColor", {0.5, 0.6, 0.7}}, {"attenuationDistance", 2}}},
           {"KHR_materials_volume_scatter", scatter}}}});
  };
  const Material m = solid({{"multiscatterColorFactor", {0, 0.5, 1}}, {"scatterAnisotropy", -0.25}});
  CHECK(m.scatters());
  CHECK(m.scatterAnisotropy == -0.25f);
  CHECK(m.scatterAlbedo.x == 0);
  CHECK(m.scatterAlbedo.y == doctest::Approx(0.911709).epsilon(1e-5));  // the formula, worked out by hand
  CHECK(m.scatterAlbedo.z == 1);
  // The name of older drafts; the newer one wins.
  CHECK(solid({{"multiscatterColor", {0, 0.5, 1}}}).scatterAlbedo == m.scatterAlbedo);
  CHECK(solid({{"multiscatterColor", {1, 1, 1}}, {"multiscatterColorFactor", {0, 0.5, 1}}}).scatterAlbedo ==
        m.scatterAlbedo);
  CHECK_FALSE(solid(Json::object()).scatters());
}

TEST_CASE("gltf: material extensions of reflection") {
  const Material specular = loadMaterial(
      withExtension("KHR_materials_specular", {{"specularFactor", 0.5}, {"specularColorFactor", {2, 1, 0}}}));
  CHECK(specular.specular == 0.5f);
  CHECK(specular.specularColor == Spectrum(2, 1, 0));
  const Material coat = loadMaterial(
      withExtension("KHR_materials_clearcoat", {{"clearcoatFactor", 1}, {"clearcoatRoughnessFactor", 0.1}}));
  CHECK(coat.clearcoat == 1);
  CHECK(coat.clearcoatRoughness == 0.1f);
  const Material sheen = loadMaterial(
      withExtension("KHR_materials_sheen", {{"sheenColorFactor", {1, 0, 0}}, {"sheenRoughnessFactor", 0.3}}));
  CHECK(sheen.sheenColor == Spectrum(1, 0, 0));
  CHECK(sheen.sheenRoughness == 0.3f);
  const Material brushed = loadMaterial(
      withExtension("KHR_materials_anisotropy", {{"anisotropyStrength", 0.6}, {"anisotropyRotation", 1.5}}));
  CHECK(brushed.anisotropy == 0.6f);
  CHECK(brushed.anisotropyRotation == 1.5f);
  CHECK(brushed.needsTangents());
  const Material film = loadMaterial(
      withExtension("KHR_materials_iridescence",
                    {{"iridescenceFactor", 1}, {"iridescenceIor", 1.8}, {"iridescenceThicknessMaximum", 500}}));
  CHECK(film.iridescence == 1);
  CHECK(film.iridescenceIor == 1.8f);
  CHECK(film.iridescenceThicknessMin == 100);
  CHECK(film.iridescenceThicknessMax == 500);
  const Material old = loadMaterial(withExtension(
      "KHR_materials_pbrSpecularGlossiness",
      {{"diffuseFactor", {0.2, 0.3, 0.4, 0.5}}, {"specularFactor", {0.1, 0.1, 0.1}}, {"glossinessFactor", 0.75}}));
  CHECK(old.specularGlossiness);
  CHECK(old.baseColor == Spectrum(0.2f, 0.3f, 0.4f));
  CHECK(old.alpha == 0.5f);
  CHECK(old.specularF0 == Spectrum(0.1f));
  CHECK(old.roughness == 0.25f);
}

TEST_CASE("gltf: factors out of range are clamped with a warning") {
  GltfFile file = quadFile();
  giveMaterial(file,
               {{"pbrMetallicRoughness", {{"metallicFactor", 1.2}, {"baseColorFactor", {-1, 0, 0, 1}}}},
                {"extensions",
                 {{"KHR_materials_ior", {{"ior", 0.5}}}, {"KHR_materials_volume", {{"attenuationDistance", 0}}}}}});
  const SceneData scene = file.load();
  CHECK(scene.materials[0].metallic == 1);
  CHECK(scene.materials[0].baseColor.x == 0);
  CHECK(scene.materials[0].ior == 1);
  CHECK(std::isinf(scene.materials[0].attenuationDistance));
  CHECK(hasWarning(scene, "/materials/0/pbrMetallicRoughness/metallicFactor: is 1.2"));
}

TEST_CASE("gltf: textures are decoded once, per use as colour or as data") {
  GltfFile file = quadFile();
  const int texture = addTexture(file), other = file.append("textures", {{"source", 0}});
  addTexture(file);  // nothing reads it
  giveMaterial(file,
               {{"pbrMetallicRoughness",
                 {{"baseColorTexture", {{"index", texture}}}, {"metallicRoughnessTexture", {{"index", texture}}}}},
                {"emissiveTexture", {{"index", other}}},
                {"emissiveFactor", {1, 1, 1}},
                {"occlusionTexture", {{"index", other}}}});
  const SceneData scene = file.load();
  REQUIRE(scene.textures.size() == 3);
  const Material& m = scene.materials[0];
  const Texture& colour = scene.textures[static_cast<size_t>(m.baseColorTexture.texture)];
  const Texture& data = scene.textures[static_cast<size_t>(m.metallicRoughnessTexture.texture)];
  const Texture& emission = scene.textures[static_cast<size_t>(m.emissiveTexture.texture)];
  CHECK(colour.srgb());
  CHECK_FALSE(data.srgb());
  CHECK(colour.sharedImage() == data.sharedImage());
  CHECK(colour.sharedImage() == emission.sharedImage());
  CHECK(data.sample(Vec2(0.5f)).y == doctest::Approx(200.0 / 255));
  CHECK(colour.sample(Vec2(0.5f)).y == doctest::Approx(0.5776).epsilon(0.001));
}

TEST_CASE("gltf: images of unused materials are not read") {
  GltfFile file = quadFile();
  file.append("images", {{"uri", "missing.png"}});
  file.append("textures", {{"source", 0}});
  file.append("materials", {{"normalTexture", {{"index", 0}}}});
  CHECK(file.load().textures.empty());
  file.primitive()["material"] = 0;
  CHECK_ERROR(file, "/images/0: file 'missing.png' does not exist");
}

TEST_CASE("gltf: KHR_texture_transform becomes a matrix and may choose the uv set") {
  GltfFile file = quadFile();
  const Json transform = {{"offset", {0.25, 0.5}}, {"scale", {2, 3}}, {"rotation", kPi / 2}, {"texCoord", 1}};
  file.primitive()["attributes"]["TEXCOORD_1"] = file.accessor<float>({0, 0, 1, 0, 1, 1, 0, 1}, "VEC2");
  giveMaterial(file, {{"pbrMetallicRoughness",
                       {{"baseColorTexture",
                         {{"index", addTexture(file)}, {"extensions", {{"KHR_texture_transform", transform}}}}}}}});
  const SceneData scene = file.load();
  const TextureRef& ref = scene.materials[0].baseColorTexture;
  CHECK(ref.transformed);
  CHECK(ref.uvSet == 1);
  CHECK(scene.meshes[0].uv[0].empty());
  CHECK(scene.meshes[0].uv[1].size() == 4);
  // A quarter turn takes (u, v) to (v, -u) after scaling.
  const Vec2 moved = ref.apply(Vec2(1, 1));
  CHECK(moved.x == doctest::Approx(0.25 + 3));
  CHECK(moved.y == doctest::Approx(0.5 - 2));
}

TEST_CASE("gltf: uv sets of any number are moved into the slots of a mesh") {
  GltfFile file = quadFile();
  file.primitive()["attributes"]["TEXCOORD_2"] = file.accessor<float>({2, 2, 2, 2, 2, 2, 2, 2}, "VEC2");
  file.primitive()["attributes"]["TEXCOORD_3"] = file.accessor<float>({3, 3, 3, 3, 3, 3, 3, 3}, "VEC2");
  const int texture = addTexture(file);
  Json material = {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}, {"texCoord", 3}}}}},
                   {"emissiveFactor", {1, 1, 1}},
                   {"emissiveTexture", {{"index", texture}, {"texCoord", 2}}}};
  SUBCASE("two sets") {
    giveMaterial(file, material);
    const SceneData scene = file.load();
    const Material& m = scene.materials[0];
    CHECK(scene.meshes[0].uv[m.baseColorTexture.uvSet][0] == Vec2(3));
    CHECK(scene.meshes[0].uv[m.emissiveTexture.uvSet][0] == Vec2(2));
  }
  SUBCASE("three sets") {
    material["normalTexture"] = {{"index", texture}};
    giveMaterial(file, material);
    const SceneData scene = file.load();
    const Material& m = scene.materials[0];
    CHECK(scene.meshes[0].uv[m.baseColorTexture.uvSet][0] == Vec2(3));
    CHECK(scene.meshes[0].uv[m.emissiveTexture.uvSet][0] == Vec2(2));
    CHECK(scene.meshes[0].uv[m.normalTexture.uvSet][0] == Vec2(0, 1));
  }
  SUBCASE("more sets than a mesh holds") {
    const char* const names[] = {"clearcoatTexture", "clearcoatRoughnessTexture", "clearcoatNormalTexture"};
    material["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"] = 1;
    for (int i = 0; i < 3; ++i)
      material["extensions"]["KHR_materials_clearcoat"][names[i]] = {{"index", texture}, {"texCoord", 4 + i}};
    giveMaterial(file, material);
    CHECK(hasWarning(file.load(), "more than 4 uv sets"));
  }
  SUBCASE("a set that the mesh does not have") {
    material["emissiveTexture"]["texCoord"] = 5;
    giveMaterial(file, material);
    CHECK(hasWarning(file.load(), "TEXCOORD_5"));
  }
}

TEST_CASE("gltf: samplers, and textures in formats that cannot be read") {
  GltfFile file = quadFile();
  const int texture = addTexture(file);
  file.root["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}}};
  file.root["textures"][static_cast<size_t>(texture)]["sampler"] = 0;
  const int other = file.append("textures", {{"extensions", {{"ACME_texture", {{"source", 0}}}}}});
  file.root["extensionsUsed"] = {"ACME_texture"};
  giveMaterial(file, {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}},
                      {"normalTexture", {{"index", other}}}});
  const SceneData scene = file.load();
  CHECK(scene.materials[0].baseColorTexture);
  CHECK_FALSE(scene.materials[0].normalTexture);
  CHECK(hasWarning(scene, "/textures/1: has no image in a format that is supported"));
  CHECK(scene.extensionsIgnored == std::vector<std::string>{"ACME_texture"});
}

TEST_CASE("gltf: EXT_texture_webp takes precedence over the fallback image") {
  GltfFile file = quadFile();
  const int texture = addTexture(file);
  file.append("images", {{"uri", "missing.webp"}});
  file.root["textures"][static_cast<size_t>(texture)]["extensions"]["EXT_texture_webp"]["source"] = 1;
  giveMaterial(file, {{"normalTexture", {{"index", texture}}}});
  CHECK_ERROR(file, "missing.webp");
  const SceneData scene = file.load();
  CHECK(scene.materials[0].normalTexture);
  CHECK(hasWarning(scene, "missing.webp"));
  CHECK(hasWarning(scene, "the texture's other image is used"));
}

TEST_CASE("gltf: KHR_materials_variants") {
  GltfFile file = quadFile();
  file.root["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "red"}}, {{"name", "blue"}}};
  giveMaterial(file, {{"name", "plain"}});
  const int red = file.append("materials", {{"name", "red paint"}});
  file.primitive()["extensions"]["KHR_materials_variants"]["mappings"] = {{{"material", red}, {"variants", {0}}}};
  CHECK(file.load().materials[0].name == "plain");
  CHECK(file.load().variants == std::vector<std::string>{"red", "blue"});
  LoadOptions options;
  options.variant = "red";
  CHECK(file.load(options).materials[0].name == "red paint");
  options.variant = "blue";
  CHECK(file.load(options).materials[0].name == "plain");
  options.variant = "green";
  CHECK(errorOf(file, options).find("'red', 'blue'") != std::string::npos);
}

TEST_CASE("gltf: all materials can be made double-sided") {
  LoadOptions options;
  options.doubleSided = true;
  CHECK(triangleFile().load(options).materials[0].doubleSided);
}

}  // namespace braid::test_gltf_material
