// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/builtin_scenes.h"

#include <algorithm>
#include <map>

namespace braid {

Material diffuseMaterial(const Spectrum& albedo, const Spectrum& emission) {
  Material m;
  m.baseColor = albedo;
  m.metallic = 0;
  m.roughness = 1;
  m.specular = 0;
  m.emission = emission;
  m.doubleSided = true;
  return m;
}

void addQuad(TriangleMesh& mesh, const Vec3& p, const Vec3& a, const Vec3& b) {
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const Vec3& corner : {p, p + a, p + a + b, p + b}) mesh.positions.push_back(corner);
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

void addSphere(TriangleMesh& mesh, const Vec3& centre, float radius, int level) {
  const float g = 0.5f * (1 + std::sqrt(5.0f));
  std::vector<Vec3> points{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                           {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  std::vector<glm::uvec3> triangles{{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                                    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                                    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int l = 0; l < level; ++l) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [entry, isNew] = middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(points.size()));
      if (isNew) points.push_back(glm::normalize(points[a]) + glm::normalize(points[b]));
      return entry->second;
    };
    std::vector<glm::uvec3> finer;
    for (const glm::uvec3& t : triangles) {
      const uint32_t a = middle(t.x, t.y), b = middle(t.y, t.z), c = middle(t.z, t.x);
      for (const glm::uvec3& n :
           {glm::uvec3(t.x, a, c), glm::uvec3(t.y, b, a), glm::uvec3(t.z, c, b), glm::uvec3(a, b, c)})
        finer.push_back(n);
    }
    triangles = std::move(finer);
  }
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const Vec3& p : points) {
    mesh.normals.push_back(glm::normalize(p));
    mesh.positions.push_back(centre + radius * mesh.normals.back());
  }
  for (const glm::uvec3& t : triangles) mesh.triangles.push_back(t + glm::uvec3(first));
}

void addMesh(SceneData& data, TriangleMesh mesh, uint32_t material) {
  mesh.material = material;
  data.instances.push_back({static_cast<uint32_t>(data.meshes.size()), Mat4(1), {}});
  data.meshes.push_back(std::move(mesh));
}

namespace {

// One face of a block as a grid of n × n quads, rippled by a fraction of its size when finely divided.
void addFace(TriangleMesh& mesh, const Vec3& p, const Vec3& a, const Vec3& b, size_t n) {
  if (n <= 1) return addQuad(mesh, p, a, b);
  const Vec3 normal = glm::normalize(glm::cross(a, b));
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (size_t j = 0; j <= n; ++j)
    for (size_t i = 0; i <= n; ++i) {
      const float s = static_cast<float>(i) / static_cast<float>(n), t = static_cast<float>(j) / static_cast<float>(n);
      // Fades to zero at the edges, so that faces still meet.
      const float ripple =
          0.02f * std::sin(60 * s) * std::sin(47 * t) * std::min({1.0f, 20 * s, 20 * t, 20 * (1 - s), 20 * (1 - t)});
      mesh.positions.push_back(p + s * a + t * b + ripple * normal);
    }
  const auto row = static_cast<uint32_t>(n + 1);
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t k = first + j * row + i;
      mesh.triangles.push_back({k, k + 1, k + row + 1});
      mesh.triangles.push_back({k, k + row + 1, k + row});
    }
}

void addBlock(TriangleMesh& mesh, const Vec3& centre, const Vec3& half, float angle, size_t triangles) {
  const auto n = static_cast<size_t>(std::sqrt(static_cast<double>(triangles) / 10.0));
  const Vec3 x = half.x * Vec3(std::cos(angle), 0, -std::sin(angle)),
             z = half.z * Vec3(std::sin(angle), 0, std::cos(angle)), y(0, half.y, 0);
  addFace(mesh, centre - x - y + z, 2.0f * x, 2.0f * y, n);
  addFace(mesh, centre + x - y - z, -2.0f * x, 2.0f * y, n);
  addFace(mesh, centre + x - y + z, -2.0f * z, 2.0f * y, n);
  addFace(mesh, centre - x - y - z, 2.0f * z, 2.0f * y, n);
  addFace(mesh, centre - x + y + z, 2.0f * x, -2.0f * z, n);
}

}  // namespace

SceneData cornellBox(size_t blockTriangles) {
  SceneData data;
  data.file = "cornell (built in)";
  data.materials = {diffuseMaterial(Spectrum(0.73f)), diffuseMaterial({0.63f, 0.065f, 0.05f}),
                    diffuseMaterial({0.14f, 0.45f, 0.091f}), diffuseMaterial(Spectrum(0), Spectrum(17, 12, 4))};
  TriangleMesh white, red, green, light, blocks;
  addQuad(white, {-1, -1, 1}, {2, 0, 0}, {0, 0, -2});  // floor
  // The ceiling is a ring about the light: no gap behind it that only paths could light.
  addQuad(white, {-1, 1, -1}, {2, 0, 0}, {0, 0, 0.8f});
  addQuad(white, {-1, 1, 0.2f}, {2, 0, 0}, {0, 0, 0.8f});
  addQuad(white, {-1, 1, -0.2f}, {0.76f, 0, 0}, {0, 0, 0.4f});
  addQuad(white, {0.24f, 1, -0.2f}, {0.76f, 0, 0}, {0, 0, 0.4f});
  addQuad(white, {-1, -1, -1}, {2, 0, 0}, {0, 2, 0});  // back
  addQuad(red, {-1, -1, 1}, {0, 0, -2}, {0, 2, 0});    // left
  addQuad(green, {1, -1, -1}, {0, 0, 2}, {0, 2, 0});   // right
  addQuad(light, {-0.24f, 1, -0.2f}, {0.48f, 0, 0}, {0, 0, 0.4f});
  addBlock(blocks, {0.33f, -0.7f, 0.35f}, {0.3f, 0.3f, 0.3f}, -0.29f, blockTriangles / 2);
  addBlock(blocks, {-0.34f, -0.4f, -0.28f}, {0.3f, 0.6f, 0.3f}, 0.33f, blockTriangles / 2);
  addMesh(data, std::move(white), 0);
  addMesh(data, std::move(blocks), 0);
  addMesh(data, std::move(red), 1);
  addMesh(data, std::move(green), 2);
  addMesh(data, std::move(light), 3);
  CameraData camera;
  camera.name = "camera";
  camera.toWorld = glm::translate(Mat4(1), Vec3(0, 0, 3.8f));
  camera.yfov = 0.69f;
  data.cameras.push_back(camera);
  return data;
}

SceneData furnace(float albedo, float emission) {
  SceneData data;
  data.file = "furnace (built in)";
  data.materials = {diffuseMaterial(Spectrum(albedo), Spectrum(emission))};
  TriangleMesh sphere;
  addSphere(sphere, Vec3(0), 1, 3);
  sphere.normals.clear();  // flat: the closed form holds for the polyhedron
  addMesh(data, std::move(sphere), 0);
  data.cameras.push_back(CameraData{});
  return data;
}

}  // namespace braid
