// SPDX-License-Identifier: Apache-2.0
// How many light samples finite lights, directional ones and the environment get: by what each brings to what the
// camera sees, measured with a few thousand camera paths.
#pragma once

#include "renderer/scene/camera.h"
#include "renderer/transport/context.h"

namespace braid {

// How many kinds of lights there are.
int lightKinds(const Scene& scene);

// A fifth evenly, the rest in proportion to the root of the second moment of what a light sample of the kind brings,
// relative to the brightness of that part of the frame: these shares have the least variance of all (Lagrange). Light
// samples count by the weight that light samples have beside the BSDF's. A pure function of the scene, the camera and
// the frame.
LightKinds measureLightKinds(const TransportContext& context, const Camera& camera, int width, int height);

}  // namespace braid
