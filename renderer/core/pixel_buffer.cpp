// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/pixel_buffer.h"

#include <sys/mman.h>

#include <new>

namespace braid {

namespace {

constexpr std::align_val_t kAlignment{64};

}  // namespace

void* allocatePixels(size_t bytes) {
  if (bytes == 0) return nullptr;
  if (bytes < kMappedBytes) return std::memset(operator new(bytes, kAlignment), 0, bytes);
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  // Neighbouring buffers become one region, so huge pages may span them. A system without them says no, which is fine.
  madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

void freePixels(void* memory, size_t bytes) noexcept {
  if (!memory) return;
  if (bytes < kMappedBytes)
    operator delete(memory, kAlignment);
  else
    munmap(memory, bytes);
}

}  // namespace braid
