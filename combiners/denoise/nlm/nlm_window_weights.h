// SPDX-License-Identifier: Apache-2.0
// Non-local means weights as the regression engine wants them: by centre and row of its window, where NlmWeights makes
// them offset by offset.
//
// They are worked out once, kept in 16 bits for the centres of the models only, (2 radius + 1)² / stride² values a
// pixel, and read by several regressions. Distances grow with 1/k², so that the weights at k / 2 are the fourth powers
// of those at k.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/regression/regression.h"

namespace braid {

// The weights of the windows of (2 radius + 1)² pixels about the centres of a regression with this radius and stride.
class NlmWindowStore {
 public:
  // `zeroOrder`, if not null, gets the weighted means of `image` at every pixel: [0] at the sensitivity of the guides,
  // and [1] at half of it unless that image is empty. The others have the size of the guides before the call.
  NlmWindowStore(std::span<const NlmGuide> guides, int radius, int stride, const Rgb<float>* image = nullptr,
                 std::array<Rgb<float>, 2>* zeroOrder = nullptr);

  // As WindowWeights::row(); (cx, cy) is a centre.
  void row(int cx, int cy, int y, int x0, int x1, float* out) const;
  // Turns a row from x0 to x1 into that of half the sensitivity.
  static void halveSensitivity(int x0, int x1, float* out);

 private:
  size_t offset(int column, int row) const {
    return (static_cast<size_t>(row) * static_cast<size_t>(columns_) + static_cast<size_t>(column)) *
           static_cast<size_t>(side_ * side_);
  }
  void fillTile(std::span<const NlmGuide> guides, const PixelRect& tile, const Rgb<float>* image,
                std::array<Rgb<float>, 2>* zeroOrder);
  void storeOffset(const float* weights, int dx, int dy, const PixelRect& tile);

  int width_, height_, radius_, side_, stride_, columns_, rows_;
  // Window after window, row by row. Not initialised, which would take longer than all else: of entries outside the
  // image nobody uses the values.
  std::unique_ptr<uint16_t[]> data_;
};

// A store at the sensitivity of its guides or at half of it.
class NlmWindowWeights final : public WindowWeights {
 public:
  NlmWindowWeights(const NlmWindowStore& store, bool halfSensitivity)
      : store_(store), halfSensitivity_(halfSensitivity) {}
  void row(int cx, int cy, int y, int x0, int x1, float* out) const override {
    store_.row(cx, cy, y, x0, x1, out);
    if (halfSensitivity_) NlmWindowStore::halveSensitivity(x0, x1, out);
  }

 private:
  const NlmWindowStore& store_;
  bool halfSensitivity_;
};

}  // namespace braid
