// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ground.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/data/scene_defaults.h"

namespace braid {

namespace {

constexpr float kAlbedo = 0.5f;
// Half the side of the ground, in diagonals of the scene.
constexpr float kReach = 8;
// How far below the lowest point, in diagonals: two surfaces in one place would fight.
constexpr float kGap = 1e-4f;

// On a level surface. Turning the environment about the vertical changes nothing.
Spectrum environmentIrradiance(const EnvironmentData& environment) {
  if (!environment.image) return environment.radiance * kPi;
  const Texture texture(environment.image, true, Wrap::Repeat, Wrap::Clamp, Filter::Nearest);
  const int width = environment.image->width, height = environment.image->height;
  glm::dvec3 sum(0);
  for (int y = 0; y < (height + 1) / 2; ++y) {
    const double theta = static_cast<double>(kPi) * (y + 0.5) / height;
    glm::dvec3 row(0);
    for (int x = 0; x < width; ++x)
      row += glm::dvec3(texture.sample({(static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                                        (static_cast<float>(y) + 0.5f) / static_cast<float>(height)}));
    sum += row * std::max(0.0, std::cos(theta) * std::sin(theta));
  }
  const double texel = 2 * static_cast<double>(kPi) / width * static_cast<double>(kPi) / height;
  return environment.radiance * Spectrum(sum * texel);
}

}  // namespace

Spectrum openGroundRadiance(const SceneData& scene) {
  Spectrum irradiance(0);
  if (scene.environment) irradiance += environmentIrradiance(*scene.environment);
  for (const PunctualLight& l : scene.lights)
    if (l.kind == PunctualKind::Directional) irradiance += l.intensity * std::max(0.0f, -l.direction.y);
  return irradiance * (kAlbedo * kInvPi);
}

void matchBackdrop(SceneData& scene) {
  scene.ground = openGroundRadiance(scene);
  if (!isBlack(*scene.ground)) scene.backdrop = scene.ground;
}

void addGround(SceneData& scene) {
  const Bounds bounds = worldBounds(scene);
  if (bounds.empty()) return;
  const float diagonal = glm::length(bounds.diagonal());
  const float reach = kReach * (diagonal > 0 ? diagonal : 1);
  const Vec3 centre(bounds.centre().x, bounds.lo.y - kGap * diagonal, bounds.centre().z);
  Material paper;
  paper.name = "ground";
  paper.baseColor = Spectrum(kAlbedo);
  paper.metallic = paper.specular = 0;
  paper.isGround = true;
  TriangleMesh mesh;
  mesh.name = "ground";
  for (const Vec2& corner : {Vec2(-1, 1), Vec2(1, 1), Vec2(1, -1), Vec2(-1, -1)})
    mesh.positions.push_back(centre + reach * Vec3(corner.x, 0, corner.y));
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.padForEmbree();
  mesh.material = static_cast<uint32_t>(scene.materials.size());
  scene.materials.push_back(paper);
  scene.instances.push_back({static_cast<uint32_t>(scene.meshes.size()), Mat4(1), {}});
  scene.meshes.push_back(std::move(mesh));
  matchBackdrop(scene);
}

}  // namespace braid
