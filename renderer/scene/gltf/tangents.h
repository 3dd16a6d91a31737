// SPDX-License-Identifier: Apache-2.0
// Tangents for normal maps of meshes that bring none, in the manner of MikkTSpace.
#pragma once

#include <vector>

#include "renderer/scene/data/scene_data.h"

namespace braid {

// Fills frame 0 (mesh.tangents), 1 or 2 (mesh.otherTangents) from positions, normals and uv[frame] (one per vertex). A
// vertex where mirrored and unmirrored texture space meet is duplicated, in the mesh and in every list of `uv`.
void generateTangents(TriangleMesh& mesh, size_t frame, std::vector<std::vector<Vec2>>& uv);

}  // namespace braid
