// SPDX-License-Identifier: Apache-2.0
// What images of files may hold.
#pragma once

#include "renderer/scene/data/textures/texture.h"

namespace braid {

constexpr float kLargestRadiance = 1e18f;  // its square is a float, too

// Refuses sizes that no image of `fileBytes` bytes can have, or that are beyond what is read: Error(BadInput).
void checkImageSize(int width, int height, int channels, uint64_t fileBytes);

// Brings all floats into [0, kLargestRadiance], what is not finite to 0, and counts them.
void limitFloats(Image& image);

}  // namespace braid
