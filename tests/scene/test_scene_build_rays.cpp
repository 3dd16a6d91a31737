// SPDX-License-Identifier: Apache-2.0
// Rays in a scene: flat and one-sided surfaces, packets, and rays that leave a surface or meet an edge.
#include <doctest/doctest.h>

#include "renderer/transport/hit.h"
#include "tests/scene/scene_shapes.h"
#include "tests/support/statistics/chi_squared.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_scene_build_rays {

using namespace test::scene_shapes;
using test::Rng;

namespace {

std::vector<bool> occludedAll(const Scene& scene, const std::vector<RayQuery>& rays) {
  ShadowBatch batch;
  for (size_t i = 0; i < rays.size(); ++i) batch.set(static_cast<int>(i), rays[i]);
  bool hidden[kBatch] = {};
  scene.accel().occluded(batch, static_cast<int>(rays.size()), hidden);
  return std::vector<bool>(hidden, hidden + rays.size());
}

bool occluded(const Scene& scene, const Vec3& origin, const Vec3& direction) {
  return occludedAll(scene, {{origin, direction}})[0];
}

Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }
Vec3 randomPoint(Rng& rng) { return Vec3(rng.next(), rng.next(), rng.next()) * 2.0f - 1.0f; }

}  // namespace

TEST_CASE("A mesh pressed flat by its transform is drawn, alone and among other placements") {
  const Mat4 flat = glm::translate(Mat4(1), Vec3(0, 0, 7)) * glm::scale(Mat4(1), Vec3(1, 2, 0));
  for (const bool repeated : {false, true}) {
    TriangleMesh sphere;
    addSphere(sphere, {0, 0, 0}, 1, 3);
    SceneData data = oneMesh(std::move(sphere), singleSided(diffuseMaterial(Spectrum(0.5f), Spectrum(1))));
    data.instances[0].toWorld = flat;
    if (repeated) {
      data.instances.push_back({0, glm::translate(Mat4(1), Vec3(50, 0, 0)), {}});
      data.instances.push_back({0, glm::translate(Mat4(1), Vec3(60, 0, 0)), {}});
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
      if (instanced) data.instances.push_back({0, glm::translate(Mat4(1), Vec3(50, 0, 0)), {}});
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
    data.instances.push_back({0, turned(scale * Vec3(90, 1, 2), 2, {3, 2, 1}, {-1, 1, 3}), {}});
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

}  // namespace braid::test_scene_build_rays
