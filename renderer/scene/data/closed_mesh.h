// SPDX-License-Identifier: Apache-2.0
// Tells closed surfaces from open ones.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// Outward, inward: every edge of the mesh (vertices joined by position) is shared by two triangles that run along it in
// opposite directions, and the enclosed signed volume is positive, negative, i.e. the front faces look that way.
enum class Facing { Open, Outward, Inward };
Facing facingOf(const TriangleMesh& mesh);
inline bool isClosedOutward(const TriangleMesh& mesh) { return facingOf(mesh) == Facing::Outward; }

// Turns the front faces of a mesh to the other side, and with them its normals where these looked to the same side.
void turnInsideOut(TriangleMesh& mesh);

// Turns solids (materials with a volume) outward that are closed and look inward, but for those within the bounds of
// another solid, whose hollow they may be. Returns how many were turned; none of more than 4096 solids in all.
size_t turnSolidsOutward(SceneData& scene);

}  // namespace braid
