// SPDX-License-Identifier: Apache-2.0
// A matte ground under the scene, which shows its shadows and nothing else: where nothing shadows it, it has the colour
// of the backdrop behind it.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// The radiance of a matte, grey, level ground without anything on it, by the environment and directional lights.
Spectrum openGroundRadiance(const SceneData& scene);

// Lays it under the lowest point of the scene, so wide that its edge is far away, and gives the camera a backdrop of
// its radiance, so that there is no edge to be seen. An ordinary surface to all light.
void addGround(SceneData& scene);

// The same for a scene that has a ground already, after its lights have changed.
void matchBackdrop(SceneData& scene);

}  // namespace braid
