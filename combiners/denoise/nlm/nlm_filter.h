// SPDX-License-Identifier: Apache-2.0
// Non-local means with variance-aware distances (Rousselle et al. 2012, "Adaptive Rendering with Non-Local Means
// Filtering"), in gather form: a building block of the denoisers.
//
// The distance of a pixel pair p, q in one channel of a guide image u with variance v is
//   d² = ((u_p - u_q)² - (v_p + min(v_p, v_q))) / (k² (v_p + v_q) + eps),   at most 10⁴.
// It is averaged over the channels of the guide and over a patch of (2F + 1)² pixel pairs at the same offset, clipped
// at the borders; the weight is exp(-max(0, distance)). With several guides the largest distance counts, that is the
// smallest weight: three guides of one channel each give the minimum over red, green and blue. The weight of a pixel
// with itself is 1.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "combiners/pixels/tile_sums.h"
#include "combiners/pixels/window.h"
#include "renderer/core/plane.h"

namespace braid {

// Planes that weights are computed from, and how. All planes are finite, of one size, and outlive the filter.
struct NlmGuide {
  std::vector<const Plane<float>*> mean, variance;  // one of each per channel; variances of the mean, >= 0
  float k = 0.45f;                                  // sensitivity: larger filters more
  int patch = 3;                                    // F >= 0
  float varianceScale = 1;                          // factor on the variances, e.g. 2 for half buffers
  float epsilon = 1e-7f;
};

// Guides from one or three planes of an image and its variance, which must outlive them.
NlmGuide nlmGuide(const Plane<float>& mean, const Plane<float>& variance, float k, int patch);
NlmGuide nlmGuide(const Rgb<float>& mean, const Rgb<float>& variance, float k, int patch);

// The weights of one tile, offset by offset: for regressions and whatever else needs more than weighted means. One
// object per tile and thread.
class NlmWeights {
 public:
  // `tile` lies in the image; `window`: the largest offset in x or y. There is at least one guide, with at least one
  // channel.
  NlmWeights(std::span<const NlmGuide> guides, int window, const PixelRect& tile);

  // The weights of (p, p + (dx, dy)) for the pixels p of the tile, row by row, tile.width() apart; 0 where p + (dx, dy)
  // lies outside the image. Valid until TileSums::kAtOnce further calls.
  const float* at(int dx, int dy);

 private:
  struct Guide {
    Guide(const NlmGuide& guide, const PixelRect& around);
    const float* at(int x, int y) const;
    // The distances of `count` pairs from (x0, y) on times k², summed over the channels.
    void distances(int dx, int dy, int y, int x0, int count, float* out) const;

    PixelRect area;
    int channels, patch;
    float squareK, epsilon;
    size_t pitch;
    std::vector<float> data;
  };
  void clearOutside(const PixelRect& inside, float* weights) const;
  void addGuide(const Guide& guide, int dx, int dy, const PixelRect& inside, float* weights);

  std::vector<Guide> guides_;
  PixelRect tile_;
  int width_, height_;                                         // of the image
  std::array<std::vector<float>, TileSums::kAtOnce> weights_;  // taken in turn
  size_t next_ = 0;
  std::vector<float> difference_, rowSums_, columnScales_, patchSums_, unused_;
};

// Replaces each pixel of each target by its weighted mean over the window of (2 window + 1)² pixels, clipped at the
// borders: out[i] = filtered in[i]. Every out[i] has the size of the image and differs from every in[j] and every
// guide plane.
void nlmFilter(std::span<const NlmGuide> guides, int window, std::span<const Plane<float>* const> in,
               std::span<Plane<float>* const> out);

// The same for three planes with one guide.
Rgb<float> nlmFilter(const NlmGuide& guide, int window, const Rgb<float>& in);

}  // namespace braid
