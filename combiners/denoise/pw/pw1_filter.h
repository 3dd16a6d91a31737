// SPDX-License-Identifier: Apache-2.0
// The first-order patch-Welch filter: a weighted linear fit of the albedo-divided radiance over position, normal, depth
// and visibility, with the weights of the patch-Welch filter.
//
// A fit is made around every fifth pixel in x and y, and all pixels i of its window receive its prediction with the
// weight w(c, i) that they have in it (collaborative regression; Bitterli et al. 2016, "Nonlinearly Weighted
// First-order Regression for Denoising Monte Carlo Renderings"). Pixels that no fit accounts for, such as thin geometry
// between the centres, must not fall back to the noisy input:
//   out_i = (Σ_c w(c, i) prediction_c(i) + kappa zeroOrder_i) / (Σ_c w(c, i) + kappa).
#pragma once

#include <vector>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/regression/regression.h"

namespace braid {

struct FirstOrderOptions {
  double threshold = kPatchWelchWideThreshold;
  int stride = 5;      // of the centres; >= 1
  float kappa = 0.8f;  // weight of the zero-order result; 0 only where every pixel is a centre
  int tileSize = 128;
};

// Filters each image of `input` with its own weights, those of patchWelch() with the same threshold, whose results it
// is blended with. Deterministic; the size of the tiles changes no bit. Once `cancel` is set, tiles stay of zero order,
// or black. `report` gets the counts of the fits, of all images.
std::vector<Rgb<float>> patchWelchFirstOrder(const PatchWelchInput& input, const FirstOrderOptions& options = {},
                                             const std::atomic<bool>* cancel = nullptr,
                                             RegressionReport* report = nullptr);

}  // namespace braid
