// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/scene_defaults.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace braid {

namespace {

constexpr float kDefaultYfov = 0.7f;

Bounds localBounds(const TriangleMesh& mesh) {
  Bounds bounds;
  for (const Vec3& p : mesh.positions) bounds.extend(p);
  return bounds;
}

Vec3 corner(const Bounds& b, int index) {
  return {index & 1 ? b.hi.x : b.lo.x, index & 2 ? b.hi.y : b.lo.y, index & 4 ? b.hi.z : b.lo.z};
}

// The part of each of the six sides of the bounds that triangles close, as in a room: sides 2a (low) and 2a + 1 (high)
// of axis a.
std::array<float, 6> closedSides(const SceneData& scene, const Bounds& bounds) {
  std::array<double, 6> area{};
  const Vec3 extent = bounds.diagonal();
  for (const MeshInstance& instance : scene.instances) {
    const TriangleMesh& mesh = scene.meshes[instance.mesh];
    for (const glm::uvec3& t : mesh.triangles) {
      Vec3 p[3];
      for (int k = 0; k < 3; ++k) p[k] = Vec3(instance.toWorld * Vec4(mesh.positions[t[k]], 1));
      const Vec3 normal = 0.5f * glm::cross(p[1] - p[0], p[2] - p[0]);
      for (int side = 0; side < 6; ++side) {
        const int axis = side / 2;
        const float plane = side % 2 ? bounds.hi[axis] : bounds.lo[axis], near = 0.02f * extent[axis];
        const auto lies = [&](const Vec3& v) { return std::abs(v[axis] - plane) <= near; };
        if (lies(p[0]) && lies(p[1]) && lies(p[2]))
          area[static_cast<size_t>(side)] += static_cast<double>(std::abs(normal[axis]));
      }
    }
  }
  std::array<float, 6> closed{};
  for (size_t side = 0; side < 6; ++side) {
    const int axis = static_cast<int>(side / 2);
    const float whole = extent[(axis + 1) % 3] * extent[(axis + 2) % 3];
    closed[side] = whole > 0 ? static_cast<float>(area[side]) / whole : 0;
  }
  return closed;
}

// The way out of a box with one open side: straight through it.
std::optional<Vec3> openSide(const SceneData& scene, const Bounds& bounds) {
  // Rooms are simple; counting the triangles of large scenes would cost more than it tells.
  size_t triangles = 0;
  for (const MeshInstance& instance : scene.instances) triangles += scene.meshes[instance.mesh].triangles.size();
  if (triangles > 2'000'000) return {};
  const std::array<float, 6> closed = closedSides(scene, bounds);
  if (std::count_if(closed.begin(), closed.end(), [](float part) { return part > 0.6f; }) != 5) return {};
  Vec3 direction(0);
  for (size_t side = 0; side < 6; ++side) {
    if (closed[side] <= 0.6f) direction[static_cast<int>(side / 2)] = side % 2 ? 1.0f : -1.0f;
  }
  return direction;
}

// From the centre towards the camera. Things in glTF face +Z.
Vec3 viewDirection(const SceneData& scene, const Bounds& bounds) {
  if (const std::optional<Vec3> open = openSide(scene, bounds)) return *open;
  const Vec3 extent = bounds.diagonal();
  const int thin = extent.z <= extent.x && extent.z <= extent.y ? 2 : extent.y <= extent.x ? 1 : 0;
  const float next = std::min(extent[(thin + 1) % 3], extent[(thin + 2) % 3]);
  const bool isFlat = extent[thin] < 0.25f * next;
  if (isFlat && thin == 2) return glm::normalize(Vec3(0.12f, 0.1f, 1));
  if (isFlat && thin == 1) return glm::normalize(Vec3(0.25f, 1, 0.9f));
  if (isFlat) return glm::normalize(Vec3(1, 0.1f, 0.12f));
  return glm::normalize(Vec3(0.55f, 0.4f, 1));
}

bool shines(const PunctualLight& light) {
  return maxComponent(light.intensity) > 0 && light.range > 0 &&
         (light.kind != PunctualKind::Spot || light.outerConeAngle > 0);
}

Mat4 lookAlong(const Vec3& position, const Vec3& back) {
  const Vec3 up = std::abs(back.y) > 0.999f ? Vec3(0, 0, -1) : Vec3(0, 1, 0);
  const Vec3 x = glm::normalize(glm::cross(up, back));
  return Mat4(Vec4(x, 0), Vec4(glm::cross(back, x), 0), Vec4(back, 0), Vec4(position, 1));
}

}  // namespace

Bounds worldBounds(const SceneData& scene) {
  std::vector<Bounds> local;
  for (const TriangleMesh& mesh : scene.meshes) local.push_back(localBounds(mesh));
  Bounds bounds;
  for (const MeshInstance& instance : scene.instances) {
    for (int k = 0; k < 8; ++k) bounds.extend(Vec3(instance.toWorld * Vec4(corner(local[instance.mesh], k), 1)));
  }
  return bounds;
}

CameraData framingCamera(const SceneData& scene) {
  CameraData camera;
  camera.name = "default";
  camera.yfov = kDefaultYfov;
  const Bounds bounds = worldBounds(scene);
  if (bounds.empty()) {
    camera.toWorld = lookAlong(Vec3(0, 0, 3), Vec3(0, 0, 1));
    return camera;
  }
  const Vec3 back = viewDirection(scene, bounds);
  const Mat4 orientation = lookAlong(Vec3(0), back);
  // The nearest distance from which every corner of the bounds lies in a frame of aspect 4:3, with a margin of 5 %.
  const float tanY = std::tan(0.5f * kDefaultYfov) / 1.05f, tanX = tanY * 4 / 3;
  float distance = 0;
  for (int k = 0; k < 8; ++k) {
    const Vec3 d = corner(bounds, k) - bounds.centre();
    const float x = std::abs(glm::dot(d, Vec3(orientation[0]))), y = std::abs(glm::dot(d, Vec3(orientation[1])));
    distance = std::max(distance, glm::dot(d, back) + std::max(x / tanX, y / tanY));
  }
  camera.toWorld = lookAlong(bounds.centre() + back * (distance > 0 ? distance : 3.0f), back);
  return camera;
}

bool hasLight(const SceneData& scene) {
  if (scene.environment || std::any_of(scene.lights.begin(), scene.lights.end(), shines)) return true;
  return std::any_of(scene.materials.begin(), scene.materials.end(), [&](const Material& m) {
    if (!m.emissive()) return false;
    return !m.emissiveTexture || !scene.textures[static_cast<size_t>(m.emissiveTexture.texture)].isBlack(m.emission);
  });
}

}  // namespace braid
