// SPDX-License-Identifier: Apache-2.0
// Scene: placement of meshes, emitters, filters, traits.
#include <doctest/doctest.h>

#include "integrators/registry.h"
#include "renderer/scene/data/closed_mesh.h"
#include "renderer/session/session.h"
#include "renderer/transport/hit.h"
#include "tools/bench/builtin_scenes.h"
#include "tests/scene/scene_shapes.h"

namespace braid::test_scene_build {

using namespace test::scene_shapes;

namespace {

TriangleMesh unitQuad() { return quad(Vec3(0), {1, 0, 0}, {0, 1, 0}); }

bool filtered(TriangleMesh mesh, const Material& material) {
  return Scene(oneMesh(std::move(mesh), material)).accel().filtered();
}

SceneTraits traitsOf(const Material& material) { return Scene(oneMesh(unitQuad(), material)).traits(); }

}  // namespace

TEST_CASE("A hit on an emitter leads to the record of that triangle, in the world and in instances") {
  const Scene scene(lampsAndInstances());
  REQUIRE(scene.instances().size() == 3);
  REQUIRE(scene.emitters().size() == 2 + 3 * 2);
  for (size_t i = 0; i < scene.emitters().size(); ++i) {
    const EmissiveTriangle& e = scene.emitters()[i];
    CAPTURE(i);
    CHECK(e.area > 0);
    CHECK(glm::length(e.normal) == doctest::Approx(1));
    // The front side, as hits see it, is the side of the record's normal.
    const Vec3 centre = e.p0 + (e.e1 + e.e2) / 3.0f;
    const RayHit query = intersect(scene, centre + 0.1f * e.normal, -e.normal);
    REQUIRE(query.t < kInfinity);
    CHECK(scene.emitterIndex(query.mesh, query.triangle, query.instance) == static_cast<int64_t>(i));
    Hit hit;
    makeHit(scene, query, -e.normal, hit);
    CHECK(hit.front);
    CHECK(glm::dot(hit.ng, e.normal) == doctest::Approx(1));
    CHECK(glm::distance(hit.position, centre) < 1e-4f);
  }
  const RayHit body = intersect(scene, {5, 0, -9}, {0, 0, 1});
  REQUIRE(body.t < kInfinity);
  CHECK(scene.mesh(body.mesh).material == 0);
  CHECK(scene.emitterIndex(body.mesh, body.triangle, body.instance) == -1);
}

TEST_CASE("The bounds contain every placed vertex") {
  const SceneData data = lampsAndInstances();
  Bounds expected;
  for (const MeshInstance& i : data.instances)
    for (const Vec3& p : data.meshes[i.mesh].positions) expected.extend(Vec3(i.toWorld * Vec4(p, 1)));
  const Scene scene(lampsAndInstances());
  CHECK(glm::all(glm::lessThanEqual(scene.bounds().lo, expected.lo + 1e-4f)));
  CHECK(glm::all(glm::greaterThanEqual(scene.bounds().hi, expected.hi - 1e-4f)));
  CHECK(glm::length(scene.bounds().diagonal()) < 1.3f * glm::length(expected.diagonal()));
  const Vec3 centre = scene.traits().centre;
  CHECK(glm::distance(centre, expected.lo) <= scene.traits().radius * 1.0001f);
  const Scene shifted(oneMesh(quad({3, 4, 5}, {1, 0, 0}, {0, 1, 0}), diffuseMaterial(Spectrum(1))));
  CHECK(shifted.bounds().lo == Vec3(3, 4, 5));
  CHECK(shifted.bounds().hi == Vec3(4, 5, 5));
}

TEST_CASE("A mesh is closed when all its edges meet an opposite one and its faces look outward") {
  CHECK(isClosedOutward(cube()));
  CHECK(isClosedOutward(cube(false, true)));
  CHECK_FALSE(isClosedOutward(cube(true)));
  CHECK_FALSE(isClosedOutward(cube(false, false, 5)));
  CHECK_FALSE(isClosedOutward(TriangleMesh()));
  TriangleMesh far = cube();
  for (Vec3& p : far.positions) p = p * 1e-3f + Vec3(1000, -2000, 500);
  CHECK(isClosedOutward(far));
  TriangleMesh two = cube();
  addSphere(two, {5, 0, 0}, 1, 2);
  CHECK(isClosedOutward(two));
  std::swap(two.triangles[3].x, two.triangles[3].y);
  CHECK_FALSE(isClosedOutward(two));
}

TEST_CASE("A solid that looks inward is turned outward, with its normals, unless it may be the hollow of another") {
  CHECK(facingOf(cube(true)) == Facing::Inward);
  CHECK(facingOf(cube(false, false, 5)) == Facing::Open);
  Material glass = singleSided();
  glass.transmission = 1;
  glass.thinWalled = false;
  SceneData scene = oneMesh(cube(true), glass);
  TriangleMesh& mesh = scene.meshes[0];
  for (const Vec3& p : mesh.positions) {
    mesh.normals.push_back(-glm::normalize(p));  // to the front, which is inward
    mesh.tangents.push_back({1, 0, 0, 1});
  }
  CHECK(turnSolidsOutward(scene) == 1);
  CHECK(isClosedOutward(mesh));
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    CHECK(glm::dot(mesh.normals[i], mesh.positions[i]) > 0);
    CHECK(mesh.tangents[i].w == -1);
  }
  CHECK(turnSolidsOutward(scene) == 0);
  // Normals that look outward already stay.
  turnInsideOut(mesh);
  for (Vec3& n : mesh.normals) n = -n;
  CHECK(turnSolidsOutward(scene) == 1);
  for (size_t i = 0; i < mesh.positions.size(); ++i) CHECK(glm::dot(mesh.normals[i], mesh.positions[i]) > 0);

  // Not of glass, or the hollow of a bottle: as it is.
  scene = oneMesh(cube(true), singleSided());
  CHECK(turnSolidsOutward(scene) == 0);
  scene = oneMesh(cube(true), glass);
  scene.meshes.push_back(cube());
  scene.instances.push_back({1, glm::scale(Mat4(1), Vec3(2)), {}});
  CHECK(turnSolidsOutward(scene) == 0);
  scene.instances[1].toWorld = glm::scale(Mat4(1), Vec3(0.5f));
  CHECK(turnSolidsOutward(scene) == 1);
}

TEST_CASE("Only surfaces that let rays pass get an any-hit filter") {
  const Material plain = diffuseMaterial(Spectrum(0.5f));
  Material blend = plain, glass = singleSided(), leaf = singleSided();
  blend.alphaMode = AlphaMode::Blend;
  glass.transmission = 1;
  leaf.diffuseTransmission = 0.5f;
  CHECK_FALSE(filtered(unitQuad(), plain));
  CHECK_FALSE(filtered(cube(), singleSided()));
  CHECK_FALSE(filtered(unitQuad(), glass));
  CHECK_FALSE(filtered(unitQuad(), leaf));
  CHECK(filtered(unitQuad(), singleSided()));
  CHECK(filtered(cube(true), singleSided()));
  CHECK(filtered(unitQuad(), blend));
  SceneOptions full;
  full.full = true;
  CHECK(Scene(oneMesh(unitQuad(), plain), full).accel().filtered());
}

TEST_CASE("Traits name what a scene contains and nothing else") {
  const Material plain = diffuseMaterial(Spectrum(0.5f));
  CHECK(traitsOf(plain).flags == 0);
  CHECK(traitsOf(plain).lobes == kLobeDiffuse);
  const auto with = [&](auto change) {
    Material m = plain;
    change(m);
    return traitsOf(m).flags;
  };
  const auto lobesWith = [&](auto change) {
    Material m = plain;
    change(m);
    return traitsOf(m).lobes;
  };
  CHECK(lobesWith([](Material& m) { m.specular = 1; }) == (kLobeDiffuse | kLobeSpecular));
  CHECK(with([](Material& m) { m.alphaMode = AlphaMode::Mask; }) == kTraitAlphaMask);
  CHECK(with([](Material& m) { m.alphaMode = AlphaMode::Blend; }) == kTraitAlphaBlend);
  CHECK(with([](Material& m) { m.doubleSided = false; }) == kTraitCulledFaces);
  CHECK(with([](Material& m) { m.emission = Spectrum(1); }) == kTraitEmissiveTriangles);
  CHECK(lobesWith([](Material& m) { m.diffuseTransmission = 0.5f; }) == (kLobeDiffuse | kLobeDiffuseTransmission));
  CHECK(lobesWith([](Material& m) { m.sheenColor = Spectrum(1); }) == (kLobeDiffuse | kLobeSheen));
  CHECK(lobesWith([](Material& m) { m.iridescence = 1; }) == (kLobeDiffuse | kLobeIridescence));
  CHECK(lobesWith([](Material& m) { m.anisotropy = 1; }) == (kLobeDiffuse | kLobeAnisotropy));
  CHECK(lobesWith([](Material& m) { m.clearcoat = 1; }) == (kLobeDiffuse | kLobeClearcoat));
  CHECK(with([](Material& m) { m.clearcoat = 1; }) == kTraitSmoothSpecular);
  CHECK(with([](Material& m) { m.unlit = true; }) == kTraitUnlit);
  CHECK(lobesWith([](Material& m) { m.transmission = 1; }) == (kLobeSpecular | kLobeTransmission | kLobeMultiScatter));
  CHECK(lobesWith([](Material& m) { m.transmission = 1, m.roughness = 0; }) == (kLobeSpecular | kLobeTransmission));
  CHECK(lobesWith([](Material& m) { m.unlit = true; }) == 0);
  CHECK(with([](Material& m) { m.transmission = 1, m.thinWalled = false; }) == kTraitVolume);

  SceneData lights;
  lights.lights.resize(2);
  lights.lights[1].kind = PunctualKind::Directional;
  lights.environment.emplace().radiance = Spectrum(1);
  CHECK(Scene(std::move(lights)).traits().flags == (kTraitPointLights | kTraitDirectionalLights | kTraitEnvironment));

  const Scene scene(lampsAndInstances());
  const SceneTraits& t = scene.traits();
  CHECK(t.flags == (kTraitInstances | kTraitEmissiveTriangles));
  CHECK(t.triangles == 2 + 12 + 2);
  CHECK(t.instancedTriangles == 2 + 3 * 14);
  CHECK(t.emissiveTriangles == 8);
  CHECK(t.smallestEmitterArea == doctest::Approx(0.5));
  CHECK(t.names() == std::vector<std::string>{"instances", "emissive-triangles"});
}

TEST_CASE("A scene without triangles shows its environment") {
  SceneData data;
  data.environment.emplace().radiance = Spectrum(0.25f, 0.5f, 2);
  const Scene scene(std::move(data));
  CHECK(scene.bounds().empty());
  CHECK_FALSE(intersect(scene, Vec3(0), {0, 0, 1}).t < kInfinity);
  const auto integrators = makeIntegrators();
  Settings settings;
  settings.width = settings.height = 3;
  settings.spp = 2;
  for (const auto& integrator : integrators) {
    settings.integrators = {integrator->name()};
    const RenderResult result = Session(scene, makePlan(scene, {}, settings, pointersTo(integrators))).run();
    for (size_t i = 0; i < result.image.size(); ++i) CHECK(result.image.pixel(i) == Vec3(0.25f, 0.5f, 2));
  }
}

}  // namespace braid::test_scene_build
