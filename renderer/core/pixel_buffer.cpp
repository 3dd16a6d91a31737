// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/pixel_buffer.h"

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <mutex>
#include <new>
#include <vector>

namespace braid {

namespace {

constexpr std::align_val_t kAlignment{64};

// Mapped buffers are whole pages, so that any part of one can be given back to the system.
constexpr size_t wholePages(size_t bytes) {
  constexpr size_t kPage = 4096;
  return (bytes + kPage - 1) / kPage * kPage;
}

// Of mapped buffers. By itself, so that it may be read while the buffers are made.
std::atomic<size_t> usedBytes{0};

// Mapped buffers: what is in use is counted, what was freed is kept, the last one at the end.
class MappedBuffers {
 public:
  // Memory of a kept buffer, the latest of exactly this size or a part of the smallest larger one; null: there is none,
  // and older ones have made room for a new one.
  void* take(size_t bytes) {
    const std::lock_guard lock(mutex_);
    usedBytes += bytes;
    mostUsed_ = std::max(mostUsed_, usedBytes.load());
    size_t best = kept_.size();
    for (size_t i = kept_.size(); i > 0; --i) {
      const size_t size = kept_[i - 1].bytes;
      if (size == bytes) return remove(i - 1);
      if (size > bytes && (best == kept_.size() || size < kept_[best].bytes)) best = i - 1;
    }
    if (best < kept_.size()) return cut(best, bytes);
    while (usedBytes + held_ > mostUsed_) dropOldest();
    return nullptr;
  }

  void give(void* memory, size_t bytes) noexcept {
    const std::lock_guard lock(mutex_);
    usedBytes -= bytes;
    try {
      kept_.push_back({memory, bytes});
      held_ += bytes;
    } catch (const std::bad_alloc&) {
      munmap(memory, bytes);
    }
  }

  // What take() promised could not be had.
  void failed(size_t bytes) noexcept {
    const std::lock_guard lock(mutex_);
    usedBytes -= bytes;
    mostUsed_ = usedBytes + held_;
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

  void* cut(size_t i, size_t bytes) {
    Buffer& buffer = kept_[i];
    void* memory = buffer.memory;
    buffer.memory = static_cast<std::byte*>(memory) + bytes;
    buffer.bytes -= bytes;
    held_ -= bytes;
    return memory;
  }

  void dropOldest() noexcept {
    const size_t bytes = kept_.front().bytes;
    munmap(remove(0), bytes);
  }

  std::mutex mutex_;
  std::vector<Buffer> kept_;
  size_t held_ = 0, mostUsed_ = 0;  // bytes; used + held_ <= mostUsed_
};

// Outlives every plane, those in static storage too.
MappedBuffers& mappedBuffers() {
  static MappedBuffers& buffers = *new MappedBuffers;
  return buffers;
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
  const size_t pages = wholePages(bytes);
  void* memory = small ? operator new(bytes, kAlignment) : mappedBuffers().take(pages);
  if (memory) return zeros ? std::memset(memory, 0, bytes) : memory;
  memory = mapped(pages);
  if (memory) return memory;
  mappedBuffers().drop();
  memory = mapped(pages);
  if (memory) return memory;
  mappedBuffers().failed(pages);
  throw std::bad_alloc();
}

void freePixels(void* memory, size_t bytes) noexcept {
  if (!memory) return;
  if (bytes < kMappedBytes)
    operator delete(memory, kAlignment);
  else
    mappedBuffers().give(memory, wholePages(bytes));
}

size_t mappedPixelBytes() noexcept { return usedBytes; }

void dropKeptPixels() noexcept { mappedBuffers().drop(); }

}  // namespace braid
