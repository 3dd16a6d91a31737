// SPDX-License-Identifier: Apache-2.0
// The lossless compressions that a KTX2 file may have around its pixels.
#pragma once

#include <vector>

#include "renderer/scene/data/ktx2/container.h"

namespace braid::ktx2 {

// The first `bytes` bytes of what a level holds, by libzstd or zlib; what follows them is not unpacked. Refuses data
// that hold less. Nothing is allocated beyond that and the window of the compression, at most 128 MiB.
std::vector<uint8_t> inflate(Supercompression scheme, Bytes level, size_t bytes);

}  // namespace braid::ktx2
