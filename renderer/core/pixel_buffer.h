// SPDX-License-Identifier: Apache-2.0
// Memory of image planes. The first touch of memory costs more than most loops over it: large buffers come from the
// system as zeros, so that the loop that fills them touches them first, on all threads, and in huge pages where the
// system has any. What else touches them whole, copies and fills, does so in parallel. A few buffers that were freed
// are kept for the next ones of their size: filters make and drop planes of one size all the time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <type_traits>
#include <utility>

#include "renderer/core/parallel.h"

namespace braid {

// Bytes from which on a buffer is mapped by itself instead of taken from the heap.
constexpr size_t kMappedBytes = size_t(1) << 20;

// For buffers of which the next loop writes every value.
struct Unfilled {};
inline constexpr Unfilled kUnfilled;

// Memory aligned to 64 bytes that holds zeros, or anything. Freed buffers are kept and serve, whole or in parts, the
// next ones, because memory that no one has touched lately is slow. What is in use and kept together is never more than
// the most that was in use at once. Throws std::bad_alloc.
void* allocatePixels(size_t bytes, bool zeros);
void freePixels(void* memory, size_t bytes) noexcept;
// Gives what is kept back to the system: for the end of work that takes much memory.
void dropKeptPixels() noexcept;

// So many values of a plain type, all the same at first; owned, and copied with it.
template <class T>
class PixelBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  using value_type = T;

  PixelBuffer() = default;
  PixelBuffer(size_t size, Unfilled) : PixelBuffer(size, Zeros{false}) {}
  PixelBuffer(size_t size, const T& value) : PixelBuffer(size, Zeros{isZero(value)}) {
    if (!isZero(value)) inParallel([&](size_t begin, size_t end) { std::fill(data_ + begin, data_ + end, value); });
  }
  PixelBuffer(const PixelBuffer& other) : PixelBuffer(other.size_, kUnfilled) { copy(other); }
  PixelBuffer(PixelBuffer&& other) noexcept { swap(other); }
  PixelBuffer& operator=(const PixelBuffer& other) {
    if (this == &other) return *this;
    if (size_ == other.size_)
      copy(other);
    else
      PixelBuffer(other).swap(*this);
    return *this;
  }
  PixelBuffer& operator=(PixelBuffer&& other) noexcept {
    PixelBuffer(std::move(other)).swap(*this);
    return *this;
  }
  ~PixelBuffer() { freePixels(data_, size_ * sizeof(T)); }

  void swap(PixelBuffer& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }

  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* data() { return data_; }
  const T* data() const { return data_; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }

  friend bool operator==(const PixelBuffer& a, const PixelBuffer& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  struct Zeros {
    bool wanted;
  };
  PixelBuffer(size_t size, Zeros zeros)
      : data_(static_cast<T*>(allocatePixels(size * sizeof(T), zeros.wanted))), size_(size) {}

  static bool isZero(const T& value) {
    const T zero{};
    return std::memcmp(&value, &zero, sizeof(T)) == 0;
  }

  template <class Body>
  void inParallel(const Body& body) {
    constexpr size_t kChunk = size_t(1) << 16;
    if (size_ * sizeof(T) < kMappedBytes)
      body(size_t(0), size_);
    else
      parallelChunks(size_, kChunk, body);
  }

  void copy(const PixelBuffer& other) {
    inParallel([&](size_t begin, size_t end) { std::copy(other.data_ + begin, other.data_ + end, data_ + begin); });
  }

  T* data_ = nullptr;
  size_t size_ = 0;
};

// Bytes of the mapped buffers that are in use now, for those who count memory. Takes no lock: allocators may ask.
size_t mappedPixelBytes() noexcept;

}  // namespace braid
