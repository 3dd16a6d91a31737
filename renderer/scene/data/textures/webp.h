// SPDX-License-Identifier: Apache-2.0
// WebP images by libwebp: OpenImageIO's reader multiplies colours by alpha whatever it is asked for.
#pragma once

#include <memory>
#include <string>

#include "renderer/scene/data/textures/texture.h"

namespace braid {

bool isWebp(const uint8_t* data, size_t bytes);

// Decodes a WebP image, of an animation the first picture, with unassociated alpha if it has any. Throws
// Error(BadInput) with a one-line reason.
std::shared_ptr<const Image> decodeWebp(const uint8_t* data, size_t bytes, const std::string& name);

}  // namespace braid
