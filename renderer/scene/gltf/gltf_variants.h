// SPDX-License-Identifier: Apache-2.0
// KHR_materials_variants: which material a primitive has in which variant.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

// The index of the variant of this name; -1 for an empty name. Throws SceneError(BadInput) naming the variants there
// are.
int chosenVariant(const Document& document, const std::string& name);

// Variant and material, in the order of the file.
std::vector<std::pair<int, int>> variantsOf(const Primitive& primitive);

}  // namespace braid::gltf
