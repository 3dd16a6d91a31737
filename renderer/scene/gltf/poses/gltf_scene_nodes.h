// SPDX-License-Identifier: Apache-2.0
// Which nodes the scene has, and which of them the picture depends on.
#pragma once

#include <vector>

#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

// Depth first in the order of the file; each is marked as used. Throws SceneError for a scene that does not exist.
std::vector<int> nodesOfScene(Document& document, const LoadOptions& options);

// Of those: what is seen, the lights, the camera that looks, and joints; ascending.
std::vector<int> nodesThatShow(const Document& document, const LoadOptions& options, const std::vector<int>& nodes);

}  // namespace braid::gltf
