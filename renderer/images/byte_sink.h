// SPDX-License-Identifier: Apache-2.0
// Where the bytes of an image file go.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace braid {

class ByteSink {
 public:
  virtual ~ByteSink() = default;
  // Writes at the position and moves it; returns how many bytes were written.
  virtual size_t write(const void* data, size_t size) = 0;
  virtual bool seek(int64_t offset) = 0;
  virtual int64_t tell() const = 0;
  virtual size_t size() const = 0;
};

class MemorySink : public ByteSink {
 public:
  size_t write(const void* data, size_t size) override {
    if (bytes_.size() < position_ + size) bytes_.resize(position_ + size);
    if (size > 0) std::memcpy(bytes_.data() + position_, data, size);
    position_ += size;
    return size;
  }
  bool seek(int64_t offset) override {
    if (offset < 0) return false;
    position_ = static_cast<size_t>(offset);
    return true;
  }
  int64_t tell() const override { return static_cast<int64_t>(position_); }
  size_t size() const override { return bytes_.size(); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  size_t position_ = 0;
};

}  // namespace braid
