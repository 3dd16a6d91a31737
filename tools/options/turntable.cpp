// SPDX-License-Identifier: Apache-2.0
#include "tools/options/turntable.h"

#include <glm/gtc/constants.hpp>

namespace braid {

glm::dvec3 turntableAxis(const Bounds& bounds, const glm::dvec3& origin) {
  return origin + 0.5 * (glm::dvec3(bounds.lo) + glm::dvec3(bounds.hi));
}

void turnAbout(const glm::dvec3& axis, const glm::dvec3& origin, double turns, CameraData& camera) {
  if (turns == 0) return;  // to the bit
  const glm::dvec3 foot = axis - origin;
  const double angle = 2 * glm::pi<double>() * turns;
  const glm::dmat4 turn = glm::translate(glm::dmat4(1), foot) * glm::rotate(glm::dmat4(1), angle, glm::dvec3(0, 1, 0)) *
                          glm::translate(glm::dmat4(1), -foot);
  camera.toWorld = Mat4(turn * glm::dmat4(camera.toWorld));
  for (Mat4& step : camera.steps) step = Mat4(turn * glm::dmat4(step));
}

}  // namespace braid
