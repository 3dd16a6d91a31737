// SPDX-License-Identifier: Apache-2.0
// What the patch-Welch filters see of a tile: radiance divided by albedo, its variance, and scaled features.
//
// The albedo of the first hit is taken out of the radiance before filtering and put back afterwards (demodulation), so
// that textures do not keep pixels apart. It is treated as exact.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "combiners/pixels/window.h"
#include "renderer/core/pixel_buffer.h"
#include "renderer/film/estimates.h"

namespace braid {

// One estimate and its features, as the filters use them: one image, or three with the halves. The references outlive
// this.
struct PatchWelchInput {
  const Features* features = nullptr;     // null, or with planes that may be empty
  std::vector<const Rgb<float>*> images;  // the mean; then the halves, if there are any
  Rgb<float> variance;                    // of the mean, regularised; that of a half is twice as large
  uint64_t passes = 0;
  float depthScale = 0;  // 1 / mean depth of what was hit

  static constexpr size_t kMaxImages = 3;
  // Var images[i] / Var images[0].
  static float varianceFactor(size_t image) { return image == 0 ? 1.0f : 2.0f; }
  int width() const { return images[0]->width(); }
  int height() const { return images[0]->height(); }
};

// The input of an estimate. Its variance is empty where nothing is known of it (see regularisedVariance); there is
// nothing to filter then.
PatchWelchInput patchWelchInput(const Estimate& estimate, const Features* features, bool robustVariance = false);

// Contiguous copies of the pixels of a rectangle. Non-finite values are zero. Rows are padded so that whole vectors
// may be read before their beginnings and past their ends, by up to 32 values.
struct PatchWelchTile {
  static constexpr int kMargin = 32, kUnit = 16;  // floats of half a row's padding, and of the widest vector
  static constexpr size_t kGuides = 6;
  using Plane3 = std::array<PixelBuffer<float>, 3>;

  PixelRect rect;  // of the image
  ptrdiff_t pitch = 0;
  std::vector<Plane3> radiance;  // per image: mean / divisor
  Plane3 variance;               // variance of the mean / divisor²
  Plane3 divisor;                // max(albedo, 0.03); 1 on emitters, misses and without features
  // Albedo in [0, 1] and normal, times sqrt(log2(e) / (2 sd²)): 2^-|difference|² is the product of both Gaussian edge
  // terms. Zero without features. The first guide keeps pixels where every ray has missed the scene apart from those
  // with hits: they hold no light of the scene's, and have no albedo by which an edge's light could be put back.
  std::array<PixelBuffer<float>, kGuides> guide;
  PixelBuffer<float> depth, visibility;  // depth in units of the mean depth; zero without features

  // In every row the pixel of the column `alignedColumn`, one of the rectangle's, is aligned for the widest vectors.
  PatchWelchTile(const PatchWelchInput& input, const PixelRect& pixels, int alignedColumn);
  ptrdiff_t index(int x, int y) const { return static_cast<ptrdiff_t>(y - rect.y0) * pitch + (x - begin_); }

 private:
  int begin_;  // the column that rows begin with, outside of the rectangle

  void storeRow(const PatchWelchInput& input, int y);
  void storeFeatures(const Features& features, float depthScale, size_t from, size_t at);  // of a row
};

}  // namespace braid
