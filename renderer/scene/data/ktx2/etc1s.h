// SPDX-License-Identifier: Apache-2.0
// ETC1S: a base colour, and one of four brightness steps for every texel (Khronos Data Format 1.4, ETC1 and ETC1S).
#pragma once

#include "renderer/scene/data/ktx2/basis_lz.h"
#include "renderer/scene/data/ktx2/texels.h"

namespace braid::ktx2 {

// The four colours of a block, from the darkest to the brightest, opaque.
std::array<Texel, 4> etc1sColours(const Endpoint& endpoint);

// Decodes the first image of a level. Alpha is that of the second slice (its green), or 255 where there is none.
ByteTexels decodeEtc1s(const BasisLz& basis, Bytes level, size_t width, size_t height);

}  // namespace braid::ktx2
