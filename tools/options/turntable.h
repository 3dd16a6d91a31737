// SPDX-License-Identifier: Apache-2.0
// A camera that goes about the scene's vertical axis.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// Where the axis stands, in the coordinates of the file: in the middle of the bounds of a scene with this origin.
glm::dvec3 turntableAxis(const Bounds& bounds, const glm::dvec3& origin);

// Turns the camera by a part of a whole turn, counter-clockwise as seen from above. `origin` is that of its scene.
void turnAbout(const glm::dvec3& axis, const glm::dvec3& origin, double turns, CameraData& camera);

}  // namespace braid
