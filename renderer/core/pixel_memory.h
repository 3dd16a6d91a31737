// SPDX-License-Identifier: Apache-2.0
// What image planes take besides the heap, for those who count memory.
#pragma once

#include <cstddef>

namespace braid {

// Bytes of the mapped buffers (pixel_buffer.h) that are in use now. Takes no lock: allocators may ask.
size_t mappedPixelBytes() noexcept;

}  // namespace braid
