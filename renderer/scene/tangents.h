// SPDX-License-Identifier: Apache-2.0
// Tangents for normal maps of meshes that bring none, in the manner of MikkTSpace.
#pragma once

#include <vector>

#include "renderer/scene/scene_data.h"

namespace braid {

// Fills mesh.tangents from positions, normals and `uv` (one per vertex). A vertex where mirrored and unmirrored texture
// space meet is duplicated.
void generateTangents(TriangleMesh& mesh, const std::vector<Vec2>& uv);

}  // namespace braid
