// SPDX-License-Identifier: Apache-2.0
// Image planes: contiguous row-major storage, one plane a channel, so that statistics vectorise and EXR gets what it
// wants.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/core/pixel_buffer.h"
#include "renderer/core/vec.h"

namespace braid {

// What a file may ask for at most: beyond it lies an error in the file more likely than an image.
constexpr int64_t kMaxPixels = int64_t(1) << 28;

template <class T>
struct Plane {
  int width = 0, height = 0;
  PixelBuffer<T> data;

  Plane() = default;
  Plane(int w, int h, T value = T{})
      : width(w), height(h), data(static_cast<size_t>(w) * static_cast<size_t>(h), value) {}
  Plane(int w, int h, Unfilled unfilled)
      : width(w), height(h), data(static_cast<size_t>(w) * static_cast<size_t>(h), unfilled) {}

  size_t size() const { return data.size(); }
  bool empty() const { return data.empty(); }
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  }
  T& at(int x, int y) { return data[index(x, y)]; }
  const T& at(int x, int y) const { return data[index(x, y)]; }
  T& operator[](size_t i) { return data[i]; }
  const T& operator[](size_t i) const { return data[i]; }
};

// Three planes of one size: red, green, blue (or x, y, z).
template <class T>
struct Rgb {
  std::array<Plane<T>, 3> channel;

  Rgb() = default;
  Rgb(int w, int h, T value = T{}) : channel{Plane<T>(w, h, value), Plane<T>(w, h, value), Plane<T>(w, h, value)} {}

  Rgb(int w, int h, Unfilled unfilled)
      : channel{Plane<T>(w, h, unfilled), Plane<T>(w, h, unfilled), Plane<T>(w, h, unfilled)} {}

  int width() const { return channel[0].width; }
  int height() const { return channel[0].height; }
  size_t size() const { return channel[0].size(); }
  bool empty() const { return channel[0].empty(); }
  Plane<T>& operator[](size_t c) { return channel[c]; }
  const Plane<T>& operator[](size_t c) const { return channel[c]; }
  Vec3 pixel(size_t i) const {
    return Vec3(static_cast<float>(channel[0][i]), static_cast<float>(channel[1][i]),
                static_cast<float>(channel[2][i]));
  }
  void set(size_t i, const Vec3& v) {
    channel[0][i] = static_cast<T>(v.x);
    channel[1][i] = static_cast<T>(v.y);
    channel[2][i] = static_cast<T>(v.z);
  }
};

// (a + b) / 2 of two images of one size.
inline Rgb<float> average(const Rgb<float>& a, const Rgb<float>& b) {
  Rgb<float> out = a;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < out.size(); ++i) out[c][i] = 0.5f * a[c][i] + 0.5f * b[c][i];
  return out;
}

}  // namespace braid
