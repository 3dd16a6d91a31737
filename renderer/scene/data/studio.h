// SPDX-License-Identifier: Apache-2.0
// The studio that lights files without light: three soft boxes in a room of grey paper.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// An image of the surroundings whose mean radiance over all directions is as given. Its front, from which things in
// glTF are looked at, is +Z:
//
//   key     a large box, left of the camera, 45° up; most of the light, so that shadows have a direction
//   fill    a weaker, upright one at the right
//   rim     a long, narrow one behind, above: an edge of light
//   paper   dark below, brightest at the horizon, darker toward the zenith
//
// Edges are soft over a few degrees, so that the image's own interpolation shows them.
EnvironmentData studioEnvironment(float meanRadiance);

}  // namespace braid
