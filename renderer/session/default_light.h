// SPDX-License-Identifier: Apache-2.0
// The light that a scene gets whose own lights do not light what the camera sees.
#pragma once

#include <optional>
#include <string>

#include "renderer/scene/scene.h"

namespace braid {

// Adds light of this kind, a studio or a grey dome, where the lights of the file light less than a hundredth of what
// the camera sees, and less than a quarter of it shines by itself (labels and lamps on a thing do not show the thing).
// Returns what to tell the user: that, or that the picture stays dark all the same. A pure function of the scene, the
// camera and the shape of the frame, so that every command and every machine decides alike. Nothing is added to scenes
// with an environment or without anything that emits (the loader has decided on these) and where all that is seen is
// unlit. With the kind None and under a black environment nothing is added either, but that it stays dark is told.
//
// The light is compared with that of the dome, which is that of the studio on average, or with the radiance of the
// brightest emitter where that is less, so that a scene of dim lamps is as lit as the same scene with bright ones.
// `scale` is --light-scale, by which all lights of the scene have been multiplied.
std::optional<std::string> lightIfDark(Scene& scene, const CameraData& camera, int width, int height, float scale = 1,
                                       DefaultLight kind = DefaultLight::Studio);

}  // namespace braid
