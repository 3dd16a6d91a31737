// SPDX-License-Identifier: Apache-2.0
// Faces back to back in one place: every ray meets the one that faces it.
#include <doctest/doctest.h>

#include "renderer/transport/hit.h"
#include "tests/support/counts.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_coincident {

using namespace test;

namespace {

Material paint(const Spectrum& albedo) {
  Material m = diffuseMaterial(albedo);
  m.doubleSided = false;
  return m;
}

// A parallelogram in a general direction; its back is the same turned round, cut along the other diagonal or by finer
// triangles.
struct Wall {
  Vec3 p, a, b;
};

TriangleMesh front(const Wall& w) {
  TriangleMesh mesh;
  addQuad(mesh, w.p, w.a, w.b);
  return mesh;
}

enum class Cut { Same, Other, Fine };

TriangleMesh back(const Wall& w, Cut cut) {
  TriangleMesh mesh = front(w);
  if (cut == Cut::Fine) {
    mesh = {};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        addQuad(mesh, w.p + w.a * (static_cast<float>(i) / 3) + w.b * (static_cast<float>(j) / 3), w.a / 3.0f,
                w.b / 3.0f);
  }
  if (cut == Cut::Other) mesh.triangles = {{0, 1, 3}, {1, 2, 3}};
  for (glm::uvec3& t : mesh.triangles) std::swap(t.x, t.z);
  return mesh;
}

std::vector<RayHit> trace(const Scene& scene, const std::vector<RayQuery>& rays) {
  std::vector<RayHit> hits(rays.size());
  RayBatch batch;
  for (size_t i = 0; i < rays.size(); ++i) batch.set(static_cast<int>(i), rays[i]);
  scene.accel().intersect(batch, static_cast<int>(rays.size()), hits.data());
  return hits;
}

// Rays through random points of the wall from both sides, in packets and alone: how many do not meet a face that faces
// them, of the mesh that lies on their side.
int wrongHits(const Scene& scene, const Wall& w, uint32_t frontMesh, uint32_t backMesh) {
  Rng rng(5);
  const Vec3 n = glm::normalize(glm::cross(w.a, w.b));
  int wrong = 0;
  for (int round = 0; round < 200; ++round) {
    std::vector<RayQuery> rays;
    for (int i = 0; i < (round % 2 ? 1 : 8); ++i) {
      const Vec3 target = w.p + w.a * (0.02f + 0.96f * rng.next()) + w.b * (0.02f + 0.96f * rng.next());
      const Vec3 d = squareToUniformSphere(rng.next2());
      if (std::abs(glm::dot(d, n)) < 0.01f) continue;
      rays.push_back({target - 3.0f * glm::length(w.a) * d, d});
    }
    const std::vector<RayHit> hits = trace(scene, rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      Hit hit;
      if (!(hits[i].t < kInfinity)) {
        ++wrong;
        continue;
      }
      makeHit(scene, hits[i], rays[i].direction, hit);
      const bool fromFront = glm::dot(rays[i].direction, n) < 0;
      wrong += !hit.front || hit.meshIndex != (fromFront ? frontMesh : backMesh);
    }
  }
  return wrong;
}

const Wall kWalls[] = {{{-1, -1, 0}, {2, 0, 0}, {0, 2, 0}},
                       {{3.1f, -7.7f, 2.3f}, {1.3f, 0.4f, -0.2f}, {-0.3f, 1.1f, 0.9f}},
                       {{113.1f, -97.7f, 82.3f}, {1.3f, 0.4f, -0.2f}, {-0.3f, 1.1f, 0.9f}},
                       {{1e-3f, 2e-3f, 0}, {1e-4f, 2e-5f, 0}, {0, 1e-5f, 1e-4f}}};

}  // namespace

TEST_CASE("Of two faces back to back every ray meets the one that faces it") {
  for (const Wall& w : kWalls)
    for (const Cut cut : {Cut::Same, Cut::Other, Cut::Fine})
      for (const bool backFirst : {false, true})
        for (const bool doubleSided : {false, true}) {
          SceneData data;
          data.materials = {paint(Spectrum(0.5f)), paint(Spectrum(0.2f))};
          for (Material& m : data.materials) m.doubleSided = doubleSided;
          if (backFirst) addMesh(data, back(w, cut), 1);
          addMesh(data, front(w), 0);
          if (!backFirst) addMesh(data, back(w, cut), 1);
          const Scene scene(std::move(data));
          CAPTURE(static_cast<int>(cut));
          CAPTURE(backFirst);
          CAPTURE(doubleSided);
          CHECK(wrongHits(scene, w, backFirst, !backFirst) == 0);
        }
}

TEST_CASE("Faces back to back in one mesh, doubled, and as two placements of one mesh") {
  const Wall& w = kWalls[1];
  for (const Cut cut : {Cut::Same, Cut::Other}) {
    TriangleMesh both = front(w);
    const TriangleMesh other = back(w, cut);
    const auto first = static_cast<uint32_t>(both.positions.size());
    both.positions.insert(both.positions.end(), other.positions.begin(), other.positions.end());
    for (const glm::uvec3& t : other.triangles) both.triangles.push_back(t + first);
    const std::vector<glm::uvec3> triangles = both.triangles;
    both.triangles.insert(both.triangles.end(), triangles.begin(), triangles.end());
    SceneData data;
    data.materials = {paint(Spectrum(0.5f))};
    addMesh(data, std::move(both), 0);
    CHECK(wrongHits(Scene(std::move(data)), w, 0, 0) == 0);
  }
  // Half a turn about an axis in the wall, through its middle.
  for (const Vec3& at : {Vec3(0), Vec3(40.3f, -20.1f, 7.7f)}) {
    SceneData data;
    data.materials = {paint(Spectrum(0.5f))};
    addMesh(data, front(kWalls[0]), 0);
    data.instances[0].toWorld = glm::translate(Mat4(1), at);
    data.instances.push_back({0, glm::rotate(glm::translate(Mat4(1), at), kPi, Vec3(0, 1, 0)), {}});
    CHECK(wrongHits(Scene(std::move(data)), {kWalls[0].p + at, kWalls[0].a, kWalls[0].b}, 0, 0) == 0);
  }
}

TEST_CASE("A lone back face is met, and so is one whose partner is a hole, is glass, or stands apart") {
  const Wall& w = kWalls[0];
  const auto seenFromBehind = [&](const std::vector<Material>& materials, float apart = 0) {
    SceneData data;
    data.materials = materials;
    addMesh(data, front(w), 0);
    Wall moved = w;
    moved.p.z -= apart;
    if (materials.size() > 1) addMesh(data, back(moved, Cut::Same), 1);
    const Scene scene(std::move(data));
    return trace(scene, {{{0.1f, 0.2f, -3}, {0, 0, 1}}})[0].mesh;
  };
  Material hole = paint(Spectrum(0.2f)), glass = hole;
  hole.alphaMode = AlphaMode::Mask;
  hole.alpha = 0;
  glass.transmission = 1;
  CHECK(seenFromBehind({paint(Spectrum(0.5f))}) == 0);
  CHECK(seenFromBehind({paint(Spectrum(0.5f)), hole}) == 0);
  CHECK(seenFromBehind({paint(Spectrum(0.5f)), paint(Spectrum(0.2f))}) == 1);
  // A thousandth behind: the lone back face comes first.
  CHECK(seenFromBehind({paint(Spectrum(0.5f)), paint(Spectrum(0.2f))}, -1e-3f) == 0);
}

// Every wall of the box has a face on its outside that no path can see.
SceneData boxWithOutsides(bool outsidesFirst, bool doubled) {
  SceneData box = cornellBox(), data = box;
  for (Material& m : data.materials) m.doubleSided = false;
  data.materials.push_back(paint(Spectrum(0.95f, 0.05f, 0.5f)));
  const auto paintIndex = static_cast<uint32_t>(data.materials.size() - 1);
  data.meshes.clear();
  data.instances.clear();
  const auto addOutsides = [&] {
    for (const TriangleMesh& mesh : box.meshes) {
      TriangleMesh outside = mesh;
      for (glm::uvec3& t : outside.triangles) std::swap(t.x, t.z);
      for (Vec3& n : outside.normals) n = -n;
      addMesh(data, std::move(outside), paintIndex);
    }
  };
  if (doubled && outsidesFirst) addOutsides();
  for (const TriangleMesh& mesh : box.meshes) addMesh(data, mesh, mesh.material);
  if (doubled && !outsidesFirst) addOutsides();
  return data;
}

TEST_CASE("Faces that no path sees change nothing, for camera and light paths") {
  const Scene plain(boxWithOutsides(false, false));
  for (const char* integrator : {"pt", "bdpt", "gdpt"}) {
    const std::vector<Measured> expected = passMeans(plain, settingsOf("pt", 24, 24, 64), 6);
    for (const bool outsidesFirst : {false, true}) {
      const Scene scene(boxWithOutsides(outsidesFirst, true));
      CAPTURE(std::string(integrator));
      CHECK(disagreement(passMeans(scene, settingsOf(integrator, 24, 24, 64, 9), 6), expected) < 1);
    }
  }
}

}  // namespace braid::test_coincident
