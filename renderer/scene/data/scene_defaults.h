// SPDX-License-Identifier: Apache-2.0
// What a scene gets when its file brings none: a camera that frames everything and a grey dome.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// Radiance of the grey dome, W/(m² sr).
inline constexpr float kDefaultDome = 0.5f;

Bounds worldBounds(const SceneData& scene);

// A perspective camera outside the bounds that sees all of them.
CameraData framingCamera(const SceneData& scene);

// Whether anything in the scene gives light, seen or not: lights and emissive surfaces that emit more than nothing.
bool hasLight(const SceneData& scene);

}  // namespace braid
