// SPDX-License-Identifier: Apache-2.0
// What the image module exports.
#pragma once

#include "renderer/images/image_codecs.h"

namespace braid {

inline constexpr const char* kImageModuleEntry = "braidImageCodecs";

// Null: the module is of another version.
using ImageModuleEntry = const ImageCodecs* (*)(const char* version);

}  // namespace braid
