// SPDX-License-Identifier: Apache-2.0
#include "tests/support/counted_memory.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "renderer/core/pixel_buffer.h"

namespace {

std::atomic<int64_t> held{0}, peak{0};

void* counted(void* memory) {
  if (!memory) throw std::bad_alloc();
  held += static_cast<int64_t>(malloc_usable_size(memory));
  const int64_t now = braid::test::heapBytes();
  for (int64_t most = peak; now > most && !peak.compare_exchange_weak(most, now);) {
  }
  return memory;
}

void release(void* memory) {
  if (!memory) return;
  held -= static_cast<int64_t>(malloc_usable_size(memory));
  std::free(memory);
}

size_t roundedUp(size_t bytes, std::align_val_t alignment) {
  const auto a = static_cast<size_t>(alignment);
  return (bytes + a - 1) / a * a;
}

}  // namespace

void* operator new(size_t bytes) { return counted(std::malloc(bytes > 0 ? bytes : 1)); }
void* operator new[](size_t bytes) { return operator new(bytes); }
void* operator new(size_t bytes, std::align_val_t alignment) {
  return counted(std::aligned_alloc(static_cast<size_t>(alignment), roundedUp(bytes > 0 ? bytes : 1, alignment)));
}
void* operator new[](size_t bytes, std::align_val_t alignment) { return operator new(bytes, alignment); }
void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, size_t) noexcept { release(memory); }
void operator delete[](void* memory, size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, size_t, std::align_val_t) noexcept { release(memory); }

namespace braid::test {

int64_t heapBytes() { return held + static_cast<int64_t>(mappedPixelBytes()); }
int64_t heapPeak() { return peak; }
void resetHeapPeak() { peak = heapBytes(); }

}  // namespace braid::test
