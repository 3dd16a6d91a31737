// SPDX-License-Identifier: Apache-2.0
// What kernel prediction sees of an image: irradiance, which the kernels average, and the planes that the network
// reads. Training reads the same planes (tools/train), so that what a network is given is what it was trained on.
#pragma once

#include <array>

#include "renderer/film/estimates.h"

namespace braid {

// In this order: logarithms of the three channels and of the luminance's means over 5x5 and 17x17 pixels; of the
// relative standard deviation of the luminance, by itself and over 5x5 pixels; albedo; normal; depth; visibility; 1
// where light comes from no surface; noise of the features; number of passes. All of order 1.
inline constexpr int kKpnPlanes = 18;

struct KpnPlanes {
  // Radiance over what it is divided by: max(albedo, 0.03), or 1 where no surface is seen.
  Rgb<float> irradiance, divisor;
  Plane<float> variance;  // of the luminance of the irradiance
  std::array<Plane<float>, kKpnPlanes> input;

  int width() const { return variance.width; }
  int height() const { return variance.height; }
};

// What the three images of an estimate share.
struct KpnScene {
  const Features* features = nullptr;  // null, or with planes that may be empty
  Rgb<float> variance;                 // of the mean, regularised (combiners/statistics/variance.h)
  uint64_t passes = 0;                 // of the mean; 0: of a single one
};

// Of the mean, or for `half` of a half, whose variance is twice as large. `image` is normalised by exposure and finite.
KpnPlanes kpnPlanes(const Rgb<float>& image, const KpnScene& scene, bool half);

}  // namespace braid
