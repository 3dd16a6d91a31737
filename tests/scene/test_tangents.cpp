// SPDX-License-Identifier: Apache-2.0
// Tangent frames follow KHR_texture_transform: a texture that is turned or mirrored by it looks as one whose
// coordinates were transformed beforehand.
#include <doctest/doctest.h>

#include "renderer/transport/hit.h"
#include "tests/support/counts.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"

namespace braid::test_tangents {

using namespace test;

namespace {

struct Transform {
  double rotation = 0, scaleU = 1, scaleV = 1;
  Json json() const { return {{"offset", {0.3, 0.2}}, {"rotation", rotation}, {"scale", {scaleU, scaleV}}}; }
  // u' = T R S u, as the extension has it.
  Vec2 operator()(const Vec2& uv) const {
    const double c = std::cos(rotation), s = std::sin(rotation);
    const double u = scaleU * static_cast<double>(uv.x), v = scaleV * static_cast<double>(uv.y);
    return Vec2(c * u + s * v + 0.3, -s * u + c * v + 0.2);
  }
};

const Transform kTransforms[] = {{1.2, 1, 1}, {0, 1, -1}, {0, -1, 1}, {2.1, 0.5, -2}, {0, 2, 3}, {-0.7, 3, 1}};

// A folded, sheared sheet whose texture coordinates are unevenly stretched.
struct Sheet {
  std::vector<float> positions, normals;
  std::vector<Vec2> uv;
  std::vector<uint16_t> indices;
};

Sheet sheet() {
  Sheet s;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      const float x = static_cast<float>(i) / 3, y = static_cast<float>(j) / 3;
      s.positions.insert(s.positions.end(), {x + 0.3f * y, y, 0.2f * std::sin(3 * x + y)});
      const Vec3 n = glm::normalize(Vec3(-0.6f * std::cos(3 * x + y), -0.1f, 1));
      s.normals.insert(s.normals.end(), {n.x, n.y, n.z});
      s.uv.emplace_back(1.5f * x + 0.2f * y * y, 1 - 0.7f * y);
    }
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) {
      const int a = 4 * j + i;
      for (const int v : {a, a + 1, a + 5, a, a + 5, a + 4}) s.indices.push_back(static_cast<uint16_t>(v));
    }
  return s;
}

template <class Map>
int coordinates(GltfFile& file, const std::vector<Vec2>& uv, const Map& map) {
  std::vector<float> values;
  for (const Vec2& v : uv) {
    const Vec2 m = map(v);
    values.insert(values.end(), {m.x, m.y});
  }
  return file.accessor(values, "VEC2");
}

// The sheet with a set 0 of coordinates as they are and a set 1 that is transformed beforehand.
GltfFile sheetFile(const Transform& t, bool smooth = true) {
  const Sheet s = sheet();
  GltfFile file;
  Json attributes = {{"POSITION", file.accessor(s.positions, "VEC3")},
                     {"TEXCOORD_0", coordinates(file, s.uv, [](const Vec2& v) { return v; })},
                     {"TEXCOORD_1", coordinates(file, s.uv, t)}};
  if (smooth) attributes["NORMAL"] = file.accessor(s.normals, "VEC3");
  file.root["meshes"] = {
      {{"primitives", {{{"attributes", attributes}, {"indices", file.accessor(s.indices, "SCALAR")}}}}}};
  file.show();
  return file;
}

Json reference(int texture, const Transform* transform, bool beforehand) {
  Json ref = {{"index", texture}};
  if (beforehand) ref["texCoord"] = 1;
  if (transform && !beforehand) ref["extensions"]["KHR_texture_transform"] = transform->json();
  return ref;
}

// A relief of one texel that leans to the right and up.
int reliefTexture(GltfFile& file) { return addTexture(file); }

// The hits of rays from above and below on both files: frames, coat normals and directions of anisotropy.
void checkSameSurfaces(const SceneData& a, const SceneData& b) {
  const Scene one(a), two(b);
  const uint32_t lobes = materialLobes(one.materials()[0]);
  Rng rng(2);
  int compared = 0;
  for (int i = 0; i < 300; ++i) {
    const Vec3 from(1.3f * rng.next(), rng.next(), i % 2 ? 2.0f : -2.0f), d(0, 0, i % 2 ? -1.0f : 1.0f);
    RayHit queries[2];
    for (const Scene* scene : {&one, &two}) {
      RayBatch batch;
      batch.set(0, {from, d});
      scene->accel().intersect(batch, 1, &queries[scene == &two]);
    }
    if (!(queries[0].t < kInfinity)) continue;
    Hit x, y;
    makeHit(one, queries[0], d, x);
    makeHit(two, queries[1], d, y);
    CHECK(glm::length(x.frame.n - y.frame.n) < 1e-4f);
    const SurfaceParameters p = surfaceAt(one, x, lobes, 1), q = surfaceAt(two, y, lobes, 1);
    CHECK(glm::length(x.frame.toWorld(p.clearcoatNormal) - y.frame.toWorld(q.clearcoatNormal)) < 1e-4f);
    const auto anisotropy = [](const Hit& h, const SurfaceParameters& s) {
      return s.anisotropyDirection.x * h.frame.s + s.anisotropyDirection.y * h.frame.t;
    };
    CHECK(glm::length(anisotropy(x, p) - anisotropy(y, q)) < 1e-3f);
    ++compared;
  }
  CHECK(compared > 100);
}

}  // namespace

TEST_CASE("A normal map that is turned or mirrored by its transform is lit as if its coordinates were") {
  for (const Transform& t : kTransforms)
    for (const bool smooth : {true, false}) {
      CAPTURE(t.rotation);
      CAPTURE(t.scaleV);
      const auto load = [&](bool beforehand) {
        GltfFile file = sheetFile(t, smooth);
        const int texture = reliefTexture(file);
        giveMaterial(file, {{"normalTexture", reference(texture, &t, beforehand)}});
        return file.load();
      };
      const SceneData a = load(false), b = load(true);
      REQUIRE(a.meshes[0].tangents.size() == b.meshes[0].tangents.size());
      for (size_t v = 0; v < a.meshes[0].tangents.size(); ++v)
        CHECK(glm::length(a.meshes[0].tangents[v] - b.meshes[0].tangents[v]) < 1e-4f);
      checkSameSurfaces(a, b);
    }
}

TEST_CASE("Each texture of a material has the frame of its own transform") {
  // 0: the normal map is transformed, 1: the coat's, 2: the anisotropy's, 3: all, each in another way.
  for (int which = 0; which < 4; ++which)
    for (size_t k = 0; k < std::size(kTransforms); ++k) {
      CAPTURE(which);
      const Transform& t = kTransforms[k];
      const auto load = [&](bool beforehand) {
        GltfFile file = sheetFile(t);
        const int texture = reliefTexture(file);
        const auto ref = [&](int role) {
          return which == role || which == 3 ? reference(texture, &t, beforehand) : reference(texture, nullptr, false);
        };
        Json coat = {{"clearcoatFactor", 1}, {"clearcoatNormalTexture", ref(1)}},
             anisotropy = {{"anisotropyStrength", 0.8}, {"anisotropyRotation", 0.4}, {"anisotropyTexture", ref(2)}};
        giveMaterial(file,
                     {{"normalTexture", ref(0)},
                      {"doubleSided", true},
                      {"extensions", {{"KHR_materials_clearcoat", coat}, {"KHR_materials_anisotropy", anisotropy}}}});
        return file.load();
      };
      checkSameSurfaces(load(false), load(true));
    }
}

TEST_CASE("Tangents of the file are taken as they are, and offsets and stretching change none") {
  const auto tangents = [](const Transform& t, bool supplied) {
    GltfFile file = quadFile();
    if (supplied)
      file.primitive()["attributes"]["TANGENT"] =
          file.accessor<float>({0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4");
    giveMaterial(file, {{"normalTexture", reference(addTexture(file), &t, false)}});
    return file.load().meshes[0].tangents;
  };
  for (const Vec4& v : tangents({1.2, 1, -1}, true)) CHECK(v == Vec4(0, 1, 0, -1));
  for (const Vec4& v : tangents({0, 2, 5}, false)) CHECK(v == Vec4(1, 0, 0, 1));
  // Mirrored in v: the bitangent turns round, the tangent stays.
  for (const Vec4& v : tangents({0, 1, -1}, false)) CHECK(v == Vec4(1, 0, 0, -1));
  for (const Vec4& v : tangents({0, -1, 1}, false)) CHECK(v == Vec4(-1, 0, 0, -1));
}

}  // namespace braid::test_tangents
