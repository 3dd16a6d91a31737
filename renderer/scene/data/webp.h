// SPDX-License-Identifier: Apache-2.0
// WebP images by libwebp: OpenImageIO's reader multiplies colours by alpha whatever it is asked for.
#pragma once

#include <memory>
#include <string>

#include "renderer/scene/data/texture.h"

namespace braid {

bool isWebp(const uint8_t* data, size_t bytes);

// Decodes a WebP image, of an animation the first picture, with unassociated alpha if it has any. Throws
// Error(BadInput) with a one-line reason.
std::shared_ptr<const Image> decodeWebp(const uint8_t* data, size_t bytes, const std::string& name);

// Refuses sizes that no image of `fileBytes` bytes can have, or that are beyond what is read: Error(BadInput).
void checkImageSize(int width, int height, int channels, uint64_t fileBytes);

}  // namespace braid
