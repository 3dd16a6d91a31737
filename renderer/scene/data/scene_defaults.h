// SPDX-License-Identifier: Apache-2.0
// What a scene gets when its file brings none: a camera that frames what is to be seen, and light.
#pragma once

#include <string>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// Radiance of the grey dome, and mean radiance of the studio, W/(m² sr).
inline constexpr float kDefaultDome = 0.5f;
inline constexpr float kDefaultYfov = 0.7f;

Bounds worldBounds(const SceneData& scene);

// A perspective camera at a three-quarter view of the front, which glTF has in +Z, in whose frame of this aspect
// (width / height) the visible surfaces span 85 % of the width or of the height. With `turns` they do so of all that is
// seen while the camera goes about the vertical axis through the middle of the bounds.
CameraData framingCamera(const SceneData& scene, float aspect = 16 / 9.0f, float yfov = kDefaultYfov,
                         bool turns = false);

// Lights the scene, with light of `scale` times the usual radiance.
void giveDefaultLight(SceneData& scene, DefaultLight kind, float scale = 1);
// "a studio is added (...)", for warnings.
std::string describeDefaultLight(DefaultLight kind);

// Whether anything in the scene gives light, seen or not: lights and emissive surfaces that emit more than nothing.
bool hasLight(const SceneData& scene);

}  // namespace braid
