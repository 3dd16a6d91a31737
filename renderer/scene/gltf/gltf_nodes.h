// SPDX-License-Identifier: Apache-2.0
// The chosen scene of a document: meshes and their instances, cameras and lights in the world.
#pragma once

#include "renderer/scene/gltf/gltf_mesh.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"

namespace braid::gltf {

// Fills everything but textures; throws if a primitive cannot be decoded.
void buildScene(Document& document, const LoadOptions& options, MaterialTable& materials, SceneData& scene);

}  // namespace braid::gltf
