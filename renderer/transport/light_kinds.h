// SPDX-License-Identifier: Apache-2.0
// How many light samples finite lights, directional ones and the environment get: by what each brings to what the
// camera sees, measured with a few thousand camera paths.
#pragma once

#include "renderer/scene/camera.h"
#include "renderer/transport/context.h"

namespace braid {

// How many kinds of lights there are.
int lightKinds(const Scene& scene);

// A fifth evenly, the rest by the shares that minimise the second moment of what light samples and directions of the
// BSDF bring together, weighted by the balance heuristic, relative to the brightness of each part of the frame. A pure
// function of the scene, the camera and the frame.
LightKinds measureLightKinds(const TransportContext& context, const Camera& camera, int width, int height);

}  // namespace braid
