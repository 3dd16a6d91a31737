// SPDX-License-Identifier: Apache-2.0
// What of KHR_meshopt_compression Debian's meshoptimizer lacks: version 1 of the codec of attributes, and the filter
// COLOR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace braid::gltf {

inline constexpr uint8_t kMeshoptVersion1 = 0xa1;

// Decodes a stream of version 1 to `count` elements of `stride` bytes, a multiple of 4 up to 256 (appendix A, Mode 0).
// False: it is broken. Reads nothing beyond its end.
bool decodeMeshoptVertices(std::span<const uint8_t> stream, size_t count, size_t stride, uint8_t* out);

// Luma, chroma and alpha to RGBA in place (appendix B, Filter 4): four components of 8 or 16 bits, stride 4 or 8.
void decodeMeshoptColours(uint8_t* data, size_t count, size_t stride);

}  // namespace braid::gltf
