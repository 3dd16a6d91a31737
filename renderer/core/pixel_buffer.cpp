// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/pixel_buffer.h"

#include <sys/mman.h>

#include <mutex>
#include <new>
#include <vector>

namespace braid {

namespace {

constexpr std::align_val_t kAlignment{64};

// Freed buffers, the last one at the end.
class KeptBuffers {
 public:
  // One of exactly this size; null: there is none.
  void* take(size_t bytes) {
    const std::lock_guard lock(mutex_);
    for (size_t i = kept_.size(); i > 0; --i)
      if (kept_[i - 1].bytes == bytes) return remove(i - 1);
    return nullptr;
  }

  void give(void* memory, size_t bytes) noexcept {
    const std::lock_guard lock(mutex_);
    try {
      kept_.push_back({memory, bytes});
      held_ += bytes;
    } catch (const std::bad_alloc&) {
      munmap(memory, bytes);
    }
    while (held_ > kKeptBytes) dropOldest();
  }

  void drop() noexcept {
    const std::lock_guard lock(mutex_);
    while (!kept_.empty()) dropOldest();
  }

 private:
  struct Buffer {
    void* memory;
    size_t bytes;
  };

  void* remove(size_t i) {
    const Buffer buffer = kept_[i];
    kept_.erase(kept_.begin() + static_cast<std::ptrdiff_t>(i));
    held_ -= buffer.bytes;
    return buffer.memory;
  }

  void dropOldest() noexcept {
    const size_t bytes = kept_.front().bytes;
    munmap(remove(0), bytes);
  }

  std::mutex mutex_;
  std::vector<Buffer> kept_;
  size_t held_ = 0;
};

// Outlives every plane, those in static storage too.
KeptBuffers& keptBuffers() {
  static KeptBuffers& kept = *new KeptBuffers;
  return kept;
}

void* mapped(size_t bytes) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return nullptr;
  // Neighbouring buffers become one region, so huge pages may span them. A system without them says no, which is fine.
  madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

}  // namespace

void* allocatePixels(size_t bytes, bool zeros) {
  if (bytes == 0) return nullptr;
  const bool small = bytes < kMappedBytes;
  void* memory = small ? operator new(bytes, kAlignment) : keptBuffers().take(bytes);
  if (memory) return zeros ? std::memset(memory, 0, bytes) : memory;
  memory = mapped(bytes);
  if (memory) return memory;
  keptBuffers().drop();
  memory = mapped(bytes);
  if (!memory) throw std::bad_alloc();
  return memory;
}

void freePixels(void* memory, size_t bytes) noexcept {
  if (!memory) return;
  if (bytes < kMappedBytes)
    operator delete(memory, kAlignment);
  else if (bytes <= kKeptBytes)
    keptBuffers().give(memory, bytes);
  else
    munmap(memory, bytes);
}

}  // namespace braid
