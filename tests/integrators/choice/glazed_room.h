// SPDX-License-Identifier: Apache-2.0
// A closed room whose only light is the sun through a pane: the coat of the ball in it throws a faint caustic, which no
// light sample finds where it is smooth.
#pragma once

#include "tests/support/render_fixture.h"

namespace braid::test {

// The walls of a room 4 m wide, 2.6 m high and 5 m deep about x = z = 0, with a window in the wall at x = -2.
inline TriangleMesh wallsWithWindow() {
  TriangleMesh walls;
  const auto inside = [&](const Vec3& p, const Vec3& a, const Vec3& b) { addQuad(walls, p, a, b); };
  inside({-2, 0, -2.5f}, {0, 0, 5}, {4, 0, 0});     // floor
  inside({-2, 2.6f, -2.5f}, {4, 0, 0}, {0, 0, 5});  // ceiling
  inside({-2, 0, -2.5f}, {4, 0, 0}, {0, 2.6f, 0});  // back
  inside({-2, 0, 2.5f}, {0, 2.6f, 0}, {4, 0, 0});   // front
  inside({2, 0, -2.5f}, {0, 0, 5}, {0, 2.6f, 0});   // right
  inside({-2, 0, -2.5f}, {0, 0.9f, 0}, {0, 0, 5});  // left: below, above, and beside the window
  inside({-2, 2.1f, -2.5f}, {0, 0.5f, 0}, {0, 0, 5});
  inside({-2, 0.9f, -2.5f}, {0, 1.2f, 0}, {0, 0, 1.6f});
  inside({-2, 0.9f, 0.7f}, {0, 1.2f, 0}, {0, 0, 1.8f});
  return walls;
}

inline SceneData glazedRoom(float roughness = 0) {
  SceneData data;
  Material pane = diffuseMaterial(Spectrum(1));
  pane.specular = 1;
  pane.roughness = 0;
  pane.transmission = 1;
  pane.thinWalled = true;
  Material ball = diffuseMaterial({0.3f, 0.1f, 0.1f});
  ball.specular = 1;
  ball.roughness = roughness;
  data.materials = {diffuseMaterial({0.75f, 0.73f, 0.7f}), pane, ball};
  TriangleMesh glass, sphere;
  addQuad(glass, {-2, 0.9f, -0.9f}, {0, 1.2f, 0}, {0, 0, 1.6f});
  addSphere(sphere, {0, 0.4f, 0.05f}, 0.25f, 3);
  addMesh(data, wallsWithWindow(), 0);
  addMesh(data, std::move(glass), 1);
  addMesh(data, std::move(sphere), 2);
  PunctualLight sun;
  sun.kind = PunctualKind::Directional;
  sun.direction = glm::normalize(Vec3(6, -3.2f, -0.7f));
  sun.intensity = Spectrum(20);
  data.lights.push_back(sun);
  data.cameras.push_back(cameraAt({1.6f, 1.5f, 2.2f}, {-0.4f, 0.7f, -0.6f}));
  return data;
}

}  // namespace braid::test
