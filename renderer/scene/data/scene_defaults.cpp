// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/scene_defaults.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/scene/data/ground.h"
#include "renderer/scene/data/studio.h"

namespace braid {

namespace {

// Of the frame, by what it is to show; by a room, around whose open side there is nothing.
constexpr float kFramedPart = 0.85f, kFramedPartOfRoom = 0.98f;
// Vertices of more triangles would take longer to look at than they are worth: corners of bounds stand for them.
constexpr size_t kMostLookedAt = 2'000'000;

Bounds localBounds(const TriangleMesh& mesh) {
  Bounds bounds;
  for (const Vec3& p : mesh.positions) bounds.extend(p);
  return bounds;
}

Vec3 corner(const Bounds& b, int index) {
  return {index & 1 ? b.hi.x : b.lo.x, index & 2 ? b.hi.y : b.lo.y, index & 4 ? b.hi.z : b.lo.z};
}

size_t placedTriangles(const SceneData& scene) {
  size_t triangles = 0;
  for (const MeshInstance& instance : scene.instances) triangles += scene.meshes[instance.mesh].triangles.size();
  return triangles;
}

bool isVisible(const Material& m) { return m.alphaMode == AlphaMode::Opaque || m.alpha > 0; }

// The points that a camera has to see, in axes that it looks along. A camera that turns about the scene sees each of
// them on a circle about `up`, of which `points` are then the centres; circles of a still camera have no radius.
struct Framed {
  std::vector<Vec3> points;
  std::vector<float> radii;
  Vec3 up;

  void add(const Vec3& p, bool turns) {
    const Vec3 centre = glm::dot(p, up) * up;
    points.push_back(turns ? centre : p);
    radii.push_back(turns ? glm::distance(p, centre) : 0);
  }
};
Framed pointsToFrame(const SceneData& scene, const Mat3& toView, const Vec3& centre, bool turns) {
  const bool every = placedTriangles(scene) <= kMostLookedAt;
  Framed framed{{}, {}, toView[1]};
  for (const MeshInstance& instance : scene.instances) {
    const TriangleMesh& mesh = scene.meshes[instance.mesh];
    if (!isVisible(scene.materials[mesh.material])) continue;
    const auto add = [&](const Vec3& p) { framed.add(toView * (Vec3(instance.toWorld * Vec4(p, 1)) - centre), turns); };
    if (every) {
      std::vector<bool> used(mesh.positions.size());  // stray vertices show nothing
      for (const glm::uvec3& t : mesh.triangles) used[t.x] = used[t.y] = used[t.z] = true;
      for (size_t i = 0; i < used.size(); ++i)
        if (used[i]) add(mesh.positions[i]);
    } else {
      const Bounds bounds = localBounds(mesh);
      for (int k = 0; k < 8; ++k) add(corner(bounds, k));
    }
  }
  return framed;
}

// Where planes through the points touch them whose slope to the view is `slope`: a frame of that tangent has to stand
// at z = (high + low) / (2 slope) or farther, and is filled at x = (high - low) / 2 there.
struct Touch {
  float high = 0, low = 0;
  float distance(float slope) const { return (high + low) / (2 * slope); }
};
Touch touch(const Framed& framed, int axis, float slope) {
  Touch t{-kInfinity, -kInfinity};
  Vec3 high(0, 0, slope), low(0, 0, slope);
  high[axis] = 1;
  low[axis] = -1;
  // How far a circle of radius 1 reaches towards the planes.
  const float highReach = glm::length(glm::cross(high, framed.up)), lowReach = glm::length(glm::cross(low, framed.up));
  for (size_t i = 0; i < framed.points.size(); ++i) {
    const Vec3& p = framed.points[i];
    t.high = std::max(t.high, p[axis] + slope * p.z + highReach * framed.radii[i]);
    t.low = std::max(t.low, -p[axis] + slope * p.z + lowReach * framed.radii[i]);
  }
  return t;
}

// The eye, in the axes of the points, from which they span their part of the frame, centred in both directions.
Vec3 framingEye(const Framed& framed, Vec2 slopes) {
  const float distance =
      std::max(touch(framed, 0, slopes.x).distance(slopes.x), touch(framed, 1, slopes.y).distance(slopes.y));
  Vec3 eye(0, 0, distance);
  for (int axis = 0; axis < 2; ++axis) {
    float slope = slopes[axis];
    for (int i = 0; i < 8; ++i) {
      const Touch t = touch(framed, axis, slope);
      eye[axis] = 0.5f * (t.high - t.low);
      const float fitting = distance > 0 ? (t.high + t.low) / (2 * distance) : slope;
      if (!(fitting > 0) || fitting > slope) break;
      slope = fitting;
    }
  }
  return eye;
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
  if (placedTriangles(scene) > kMostLookedAt) return {};
  const std::array<float, 6> closed = closedSides(scene, bounds);
  if (std::count_if(closed.begin(), closed.end(), [](float part) { return part > 0.6f; }) != 5) return {};
  Vec3 direction(0);
  for (size_t side = 0; side < 6; ++side) {
    if (closed[side] <= 0.6f) direction[static_cast<int>(side / 2)] = side % 2 ? 1.0f : -1.0f;
  }
  return direction;
}

// From the centre towards the camera. Things in glTF face +Z.
Vec3 viewDirection(const Bounds& bounds) {
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

CameraData framingCamera(const SceneData& scene, float aspect, float yfov, bool turns) {
  CameraData camera;
  camera.name = "default";
  camera.yfov = yfov;
  const Bounds bounds = worldBounds(scene);
  camera.toWorld = lookAlong(Vec3(0, 0, 3), Vec3(0, 0, 1));
  if (bounds.empty()) return camera;
  const std::optional<Vec3> open = openSide(scene, bounds);
  const Vec3 back = open ? *open : viewDirection(bounds);
  const Mat3 toWorld(lookAlong(Vec3(0), back));
  const Framed framed = pointsToFrame(scene, glm::transpose(toWorld), bounds.centre(), turns);
  if (framed.points.empty()) return camera;
  const float slope = (open ? kFramedPartOfRoom : kFramedPart) * std::tan(0.5f * yfov);
  Vec3 eye = framingEye(framed, {slope * aspect, slope});
  if (!(eye.z > 0)) eye.z = 3;
  camera.toWorld = lookAlong(bounds.centre() + toWorld * eye, back);
  return camera;
}

void giveDefaultLight(SceneData& scene, DefaultLight kind, float scale) {
  scene.defaultLight = true;
  if (kind == DefaultLight::Studio) {
    scene.environment = studioEnvironment(kDefaultDome * scale);
    scene.backdrop = openGroundRadiance(scene);
  } else {
    scene.environment = EnvironmentData{nullptr, Spectrum(kDefaultDome * scale), 0};
  }
  if (scene.ground) matchBackdrop(scene);
}

std::string describeDefaultLight(DefaultLight kind) {
  return kind == DefaultLight::Studio
             ? "a studio is added (--no-default-light: none; --default-light dome: a grey dome)"
             : "a grey dome of radiance 0.5 is added (--no-default-light: none)";
}

bool hasLight(const SceneData& scene) {
  if (scene.environment || std::any_of(scene.lights.begin(), scene.lights.end(), shines)) return true;
  return std::any_of(scene.materials.begin(), scene.materials.end(), [&](const Material& m) {
    if (!m.emissive()) return false;
    return !m.emissiveTexture || !scene.textures[static_cast<size_t>(m.emissiveTexture.texture)].isBlack(m.emission);
  });
}

}  // namespace braid
