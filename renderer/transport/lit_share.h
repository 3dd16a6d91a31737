// SPDX-License-Identifier: Apache-2.0
// How much of what the camera sees its lights light, measured with a few thousand camera paths.
#pragma once

#include "renderer/scene/camera.h"
#include "renderer/transport/context.h"

namespace braid {

struct LitShare {
  bool seesSurfaces = false;  // whether any camera path met a surface
  double seen = 0;            // weight of the surfaces that need light: not the background, not unlit ones
  double unlit = 0;           // that of unlit ones
  // Of these, the share that emits or is met by direct light. A point counts in full from `reference` on, by the
  // radiance it emits and the radiance of a white diffuse surface there, and in proportion below it.
  double share = 0;
  double received = 0;  // the same by the light that meets them alone
};

// A pure function of the scene, the camera and the frame, with a radiance `reference` > 0 in W/(m² sr). Mirrors and
// clear glass are looked into. Ends early when much is lit, as it nearly always is.
LitShare measureLitShare(const TransportContext& context, const Camera& camera, int width, int height,
                         double reference);

}  // namespace braid
