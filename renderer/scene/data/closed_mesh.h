// SPDX-License-Identifier: Apache-2.0
// Tells closed surfaces from open ones.
#pragma once

#include "renderer/scene/data/scene_data.h"

namespace braid {

// True if every edge of the mesh (vertices joined by position) is shared by two triangles that run along it in opposite
// directions, and the enclosed signed volume is positive, i.e. the front faces look outward.
bool isClosedOutward(const TriangleMesh& mesh);

}  // namespace braid
