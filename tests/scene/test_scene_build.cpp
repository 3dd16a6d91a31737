// SPDX-License-Identifier: Apache-2.0
// Scene: placement of meshes, emitters, filters, traits, and the geometry of rays.
#include <doctest/doctest.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/scene/closed_mesh.h"
#include "renderer/session/session.h"
#include "renderer/transport/hit.h"
#include "tests/support/chi_squared.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_scene_build {

using test::Rng;

namespace {

// A cube of side 2 about the origin; faces look outward unless `inward`. Each face has vertices of its own, with flat
// normals, when `split`.
TriangleMesh cube(bool inward = false, bool split = false, int faces = 6) {
  TriangleMesh mesh;
  for (int face = 0; face < faces; ++face) {
    const int axis = face / 2;
    const float side = face % 2 ? 1.0f : -1.0f;
    Vec3 n(0), a(0), b(0);
    n[axis] = side;
    a[(axis + 1) % 3] = 2;
    b[(axis + 2) % 3] = 2 * side;
    if (inward) std::swap(a, b);
    addQuad(mesh, n - 0.5f * a - 0.5f * b, a, b);
    if (split)
      for (int k = 0; k < 4; ++k) mesh.normals.push_back(n);
  }
  return mesh;
}

TriangleMesh quad(const Vec3& p, const Vec3& a, const Vec3& b) {
  TriangleMesh mesh;
  addQuad(mesh, p, a, b);
  return mesh;
}

TriangleMesh unitQuad() { return quad(Vec3(0), {1, 0, 0}, {0, 1, 0}); }

Material singleSided(Material m = diffuseMaterial(Spectrum(0.5f))) {
  m.doubleSided = false;
  return m;
}

SceneData oneMesh(TriangleMesh mesh, const Material& material) {
  SceneData data;
  data.materials = {material};
  addMesh(data, std::move(mesh), 0);
  return data;
}

bool filtered(TriangleMesh mesh, const Material& material) {
  return Scene(oneMesh(std::move(mesh), material)).accel().filtered();
}

uint32_t flagsOf(const Material& material) { return Scene(oneMesh(unitQuad(), material)).traits().flags; }

// Traces up to kBatch rays together.
std::vector<RayHit> intersectAll(const Scene& scene, const std::vector<RayQuery>& rays) {
  RayBatch batch;
  for (size_t i = 0; i < rays.size(); ++i) batch.set(static_cast<int>(i), rays[i]);
  std::vector<RayHit> hits(rays.size());
  scene.accel().intersect(batch, static_cast<int>(rays.size()), hits.data());
  return hits;
}

std::vector<bool> occludedAll(const Scene& scene, const std::vector<RayQuery>& rays) {
  ShadowBatch batch;
  for (size_t i = 0; i < rays.size(); ++i) batch.set(static_cast<int>(i), rays[i]);
  bool hidden[kBatch] = {};
  scene.accel().occluded(batch, static_cast<int>(rays.size()), hidden);
  return std::vector<bool>(hidden, hidden + rays.size());
}

RayHit intersect(const Scene& scene, const Vec3& origin, const Vec3& direction) {
  return intersectAll(scene, {{origin, direction}})[0];
}

bool occluded(const Scene& scene, const Vec3& origin, const Vec3& direction) {
  return occludedAll(scene, {{origin, direction}})[0];
}

Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }
Vec3 randomPoint(Rng& rng) { return Vec3(rng.next(), rng.next(), rng.next()) * 2.0f - 1.0f; }

Mat4 turned(const Vec3& at, float angle, const Vec3& axis, const Vec3& scale) {
  return glm::scale(glm::rotate(glm::translate(Mat4(1), at), angle, glm::normalize(axis)), scale);
}

// A lamp of its own, and a group of two meshes, one of them emissive, placed three times, once mirrored.
SceneData lampsAndInstances() {
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f)), diffuseMaterial(Spectrum(0), Spectrum(3, 2, 1))};
  addMesh(data, quad({0, 20, 0}, {1, 0, 0}, {0, 0, 1}), 1);
  TriangleMesh body = cube(), lamp = quad({-1, -1, 1.5f}, {2, 0, 0}, {0, 2, 0});
  lamp.material = 1;
  data.meshes.push_back(body);
  data.meshes.push_back(lamp);
  const Mat4 placements[] = {turned({5, 0, 0}, 0.4f, {1, 2, 3}, Vec3(1)),
                             turned({-5, 0, 0}, 2, {0, 1, 0}, {1, 2, 0.5f}),
                             turned({0, 0, 9}, 1, {1, 0, 1}, {-1, 1, 1})};
  for (const Mat4& m : placements)
    for (const uint32_t mesh : {1u, 2u}) data.instances.push_back({mesh, m});
  return data;
}

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
  CHECK(flagsOf(plain) == 0);
  const auto with = [&](auto change) {
    Material m = plain;
    change(m);
    return flagsOf(m);
  };
  CHECK(with([](Material& m) { m.specular = 1; }) == kTraitSpecular);
  CHECK(with([](Material& m) { m.alphaMode = AlphaMode::Mask; }) == kTraitAlphaMask);
  CHECK(with([](Material& m) { m.alphaMode = AlphaMode::Blend; }) == kTraitAlphaBlend);
  CHECK(with([](Material& m) { m.doubleSided = false; }) == kTraitCulledFaces);
  CHECK(with([](Material& m) { m.emission = Spectrum(1); }) == kTraitEmissiveTriangles);
  CHECK(with([](Material& m) { m.diffuseTransmission = 0.5f; }) == kTraitDiffuseTransmission);
  CHECK(with([](Material& m) { m.sheenColor = Spectrum(1); }) == kTraitSheen);
  CHECK(with([](Material& m) { m.iridescence = 1; }) == kTraitIridescence);
  CHECK(with([](Material& m) { m.anisotropy = 1; }) == kTraitAnisotropy);
  CHECK(with([](Material& m) { m.clearcoat = 1; }) == (kTraitClearcoat | kTraitSmoothSpecular));
  CHECK(with([](Material& m) { m.unlit = true; }) == kTraitUnlit);
  CHECK(with([](Material& m) { m.transmission = 1, m.thinWalled = false; }) == (kTraitTransmission | kTraitVolume));

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

TEST_CASE("A mesh pressed flat by its transform is drawn, alone and among other placements") {
  const Mat4 flat = glm::translate(Mat4(1), Vec3(0, 0, 7)) * glm::scale(Mat4(1), Vec3(1, 2, 0));
  for (const bool repeated : {false, true}) {
    TriangleMesh sphere;
    addSphere(sphere, {0, 0, 0}, 1, 3);
    SceneData data = oneMesh(std::move(sphere), singleSided(diffuseMaterial(Spectrum(0.5f), Spectrum(1))));
    data.instances[0].toWorld = flat;
    if (repeated) {
      data.instances.push_back({0, glm::translate(Mat4(1), Vec3(50, 0, 0))});
      data.instances.push_back({0, glm::translate(Mat4(1), Vec3(60, 0, 0))});
    }
    const Scene scene(std::move(data));
    CAPTURE(repeated);
    CHECK(scene.bounds().lo.z == doctest::Approx(repeated ? -1 : 7));
    Rng rng(3);
    for (int i = 0; i < 200; ++i) {
      const Vec3 to(0.9f * randomPoint(rng).x, 1.2f * randomPoint(rng).y, 7),
          from = 5.0f * randomPoint(rng) + Vec3(0, 0, 7);
      const bool inside = sqr(to.x) + sqr(to.y / 2) < 0.95f;
      if (!inside || std::abs(from.z - 7) < 0.1f) continue;
      const Vec3 direction = glm::normalize(to - from);
      const RayHit query = intersect(scene, from, direction);
      REQUIRE(query.t < kInfinity);
      Hit hit;
      makeHit(scene, query, direction, hit);
      CHECK(hit.position.z == doctest::Approx(7));
      CHECK(hit.front);  // of its two sides the one that faces the ray
      CHECK(std::abs(hit.frame.n.z) == doctest::Approx(1));
    }
    double area = 0;
    for (const EmissiveTriangle& e : scene.emitters())
      if (e.normal.z > 0.999f && e.p0.z == 7) area += static_cast<double>(e.area);
    CHECK(area == doctest::Approx(2 * 3.14159).epsilon(0.02));
  }
}

TEST_CASE("Camera rays pass the back of an open single-sided surface, all others meet it from both sides") {
  Mat4 mirror(1);
  mirror[0][0] = -1;
  for (const bool instanced : {false, true}) {
    for (const Mat4& placement : {Mat4(1), mirror}) {
      SceneData data = oneMesh(quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), singleSided());
      data.instances[0].toWorld = placement;
      if (instanced) data.instances.push_back({0, glm::translate(Mat4(1), Vec3(50, 0, 0))});
      const Scene scene(std::move(data));
      CAPTURE(instanced);
      CAPTURE(placement[0][0]);
      const Vec3 front(0.1f, 0.2f, 3), back(0.1f, 0.2f, -3);
      CHECK(intersect(scene, front, {0, 0, -1}).t == doctest::Approx(3));
      CHECK(occluded(scene, front, {0, 0, -1}));
      CHECK(intersect(scene, back, {0, 0, 1}).t == doctest::Approx(3));
      CHECK(occluded(scene, back, {0, 0, 1}));
      const auto hits = [&](const Vec3& from, const Vec3& direction) {
        return intersectAll(scene, {{from, direction, kInfinity, kCameraRay}})[0].t < kInfinity;
      };
      CHECK(hits(front, {0, 0, -1}));
      CHECK_FALSE(hits(back, {0, 0, 1}));
    }
  }
}

TEST_CASE("A packet of rays finds what single rays find") {
  SceneData data = lampsAndInstances();
  TriangleMesh sphere;
  addSphere(sphere, {0, 0, -6}, 3, 4);
  addMesh(data, std::move(sphere), 0);
  const Scene scene(std::move(data));
  Rng rng(1);
  int different = 0, hits = 0;
  for (int round = 0; round < 1000; ++round) {
    std::vector<RayQuery> rays(static_cast<size_t>(1 + round % 20));
    for (RayQuery& ray : rays) ray = {randomPoint(rng) * 12.0f, randomDirection(rng)};
    const std::vector<RayHit> packet = intersectAll(scene, rays);
    const std::vector<bool> hidden = occludedAll(scene, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      const RayHit single = intersect(scene, rays[i].origin, rays[i].direction);
      hits += single.t < kInfinity;
      different += hidden[i] != (packet[i].t < kInfinity) || (packet[i].t < kInfinity) != (single.t < kInfinity);
      if (!(single.t < kInfinity) || !(packet[i].t < kInfinity)) continue;
      different += packet[i].mesh != single.mesh || packet[i].instance != single.instance ||
                   packet[i].triangle != single.triangle || std::fabs(packet[i].t - single.t) > 1e-5f * single.t;
    }
  }
  CHECK(hits > 500);
  CHECK(different == 0);
}

namespace {

// Triangles with vertices within `scale` of centres that are spread over 30 times that and up to `away` times it from
// the origin; as two instances when `instanced`.
SceneData scatteredTriangles(Rng& rng, float scale, float away, bool instanced) {
  TriangleMesh mesh;
  const Vec3 place = scale * away * randomPoint(rng);
  for (uint32_t t = 0; t < 300; ++t) {
    const Vec3 centre = place + scale * 30.0f * randomPoint(rng);
    for (int k = 0; k < 3; ++k) mesh.positions.push_back(centre + scale * randomPoint(rng));
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  SceneData data = oneMesh(std::move(mesh), diffuseMaterial(Spectrum(0.5f)));
  if (instanced) {
    data.instances[0].toWorld = turned(scale * Vec3(3, 1, 2), 1, {1, 2, 3}, {1.5f, 0.7f, 1});
    data.instances.push_back({0, turned(scale * Vec3(90, 1, 2), 2, {3, 2, 1}, {-1, 1, 3})});
  }
  return data;
}

// A ray toward a random point of a random triangle of mesh 0.
RayQuery rayToTriangle(const Scene& scene, Rng& rng, float distance) {
  const TriangleMesh& mesh = scene.mesh(0);
  const auto triangle = static_cast<size_t>(rng.next() * static_cast<float>(mesh.triangles.size()));
  const Vec2 b = squareToTriangle(rng.next2());
  Vec3 target = interpolate(mesh.positions, mesh.triangles[triangle], b.x, b.y);
  if (!scene.instances().empty()) target = Vec3(scene.instances()[rng.next() < 0.5f ? 0 : 1].toWorld * Vec4(target, 1));
  const Vec3 direction = randomDirection(rng);
  return {target - distance * direction, direction};
}

}  // namespace

TEST_CASE("A ray that leaves a hit point does not hit the triangle that it leaves") {
  for (const float scale : {1e-3f, 1e-1f, 1.0f, 1e2f, 1e5f}) {
    for (const float away : {0.0f, 10.0f, 100.0f, 1000.0f}) {
      for (const bool instanced : {false, true}) {
        Rng rng(static_cast<uint64_t>(away));
        const Scene scene(scatteredTriangles(rng, scale, away, instanced));
        int again = 0, tested = 0;
        for (int ray = 0; ray < 4000; ++ray) {
          const RayQuery toward = rayToTriangle(scene, rng, 3 * scale);
          const RayHit query = intersect(scene, toward.origin, toward.direction);
          if (!(query.t < kInfinity)) continue;
          Hit hit;
          makeHit(scene, query, toward.direction, hit);
          // Both sides, and shallow angles.
          Vec3 out = randomDirection(rng);
          if (ray % 2) out = glm::normalize(out - hit.ng * glm::dot(out, hit.ng) * 0.999f);
          const RayHit next = intersect(scene, offsetOrigin(hit, out), out);
          again += next.t < kInfinity && next.triangle == query.triangle && next.instance == query.instance;
          ++tested;
        }
        CAPTURE(scale);
        CAPTURE(away);
        CAPTURE(instanced);
        CHECK(tested > 2500);
        CHECK(again == 0);
      }
    }
  }
}

TEST_CASE("No ray leaves a closed sphere through its edges") {
  for (const float radius : {1e-3f, 1.0f, 1e4f}) {
    TriangleMesh sphere;
    const Vec3 centre(0.3f * radius, -2 * radius, 5 * radius);
    addSphere(sphere, centre, radius, 4);
    const TriangleMesh copy = sphere;
    const Scene scene(oneMesh(std::move(sphere), diffuseMaterial(Spectrum(0.5f))));
    Rng rng(3);
    const auto escapes = [&](const Vec3& target) {
      const Vec3 origin = centre + 0.5f * radius * randomPoint(rng);
      const std::vector<RayQuery> rays(kPacket, {origin, glm::normalize(target - origin)});
      return !(intersect(scene, origin, rays[0].direction).t < kInfinity) ||
             !(intersectAll(scene, rays)[0].t < kInfinity) || !occludedAll(scene, rays)[0];
    };
    int edges = 0, vertices = 0;
    for (const glm::uvec3& t : copy.triangles) {
      const Vec3 p = copy.positions[t.x], q = copy.positions[t.y];
      edges += escapes(0.5f * p + 0.5f * q);
      edges += escapes(glm::mix(p, q, rng.next()));
      vertices += escapes(p);
    }
    CAPTURE(radius);
    CHECK(edges == 0);
    // Embree's edge tests agree on shared edges, but where six edges meet rounding may leave a gap of the size of that
    // rounding: a few in a thousand rays aimed exactly at a vertex go through.
    CHECK(vertices <= static_cast<int>(copy.triangles.size()) / 100);
  }
}

}  // namespace braid::test_scene_build
