// SPDX-License-Identifier: Apache-2.0
// Which extensions are rendered, which a renderer satisfies by doing nothing, and which it must refuse.
#pragma once

#include "renderer/scene/gltf/document/gltf_document.h"

#include <nlohmann/json_fwd.hpp>

namespace braid::gltf {

// Throws SceneError(UnsupportedExtension) naming the required extensions that are unknown and not to be ignored.
void checkExtensions(Document& document, const nlohmann::json& root);

}  // namespace braid::gltf
