// SPDX-License-Identifier: Apache-2.0
// UASTC 4x4: blocks of 16 bytes, a subset of ASTC with a layout of its own (Khronos Data Format 1.4, "Universal ASTC").
#pragma once

#include "renderer/scene/data/ktx2/bytes.h"
#include "renderer/scene/data/ktx2/texels.h"

namespace braid::ktx2 {

constexpr size_t kUastcBlockBytes = 16;

// A block that is no valid one is magenta (255, 0, 255, 255), as the format demands. `srgb` changes how results are
// rounded, not what they mean: bytes stay encoded.
Block decodeUastcBlock(const uint8_t* block, bool srgb);

// Decodes the first image of a level, which must hold all of its blocks.
ByteTexels decodeUastc(Bytes level, size_t width, size_t height, bool srgb);

}  // namespace braid::ktx2
