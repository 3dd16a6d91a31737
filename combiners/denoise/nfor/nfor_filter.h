// SPDX-License-Identifier: Apache-2.0
// NFOR (Bitterli et al. 2016, "Nonlinearly Weighted First-order Regression for Denoising Monte Carlo Renderings";
// ALGORITHMS 4.5): colours are fitted as linear functions of prefiltered features with non-local means weights, and all
// pixels of a window receive a model's prediction.
//
//   1. Features are freed of their noise, half by half (feature_prefilter.h).
//   2. For k = 0.5 and 1: half A is regressed on the features of B with weights from the colours of B, and half B on
//      those of A, in windows of 19x19. Neither its features nor its weights then know the noise of a half.
//   3. The squared errors of both bandwidths, ½ [(B - F_A)² + (A - F_B)²] - 2 var - ¼ (F_A - F_B)², are compared after
//      filtering. 2 var cancels in the comparison, and a filter is linear: one map, the difference, is filtered.
//   4. The selection of the better bandwidth is filtered and blends the candidates of both halves to R_A and R_B.
//   5. The mean of R_A and R_B is regressed once more on the mean features, with k = 1 and the variance ¼ (R_A - R_B)².
//
// Fireflies that one half, or two quarters, alone speak for may be taken out first (fireflies.h): a regression smears
// them over its window, and neither their variance nor the other half keeps it from that.
//
// What is not in the paper can be turned off, but for the range that fits are kept in (alike_range.h). The ridge is
// 10⁻³ of the mean diagonal, on features scaled to the window (regression.h): smaller ones fit noise (3 % more error).
#pragma once

#include <atomic>

#include "combiners/regression/regression.h"
#include "combiners/method.h"

namespace braid {

// The variance that colour weights are based on.
enum class NforVariance {
  Sample,   // as estimated
  Shrunk,   // regularisedVariance(): towards a box mean. Lights up surroundings of small bright spots
  NonLocal  // filtered along the image by non-local means: windows of 11x11, patches of 3x3, k = 0.5
};

struct NforOptions {
  // Regress colour / (albedo + 0.2), with the prefiltered albedo: illumination is smoother than its
  // product with a texture, which is linear in the albedo only under even light. The constant bounds what noise of
  // colours that do not come from the albedo (reflections on dark surfaces) is multiplied by.
  bool demodulate = true;
  bool offsets = true;  // pixel offsets as features, so that smooth gradients are followed where features are flat
  NforVariance variance = NforVariance::Sample;
  // Distance of the models in pixels, >= 1; 1 is the paper's. Beyond, models are blended with a zero-order filter of
  // the same weights, for pixels that resemble no centre nearby.
  int stride = 2;
  bool removeFireflies = false;  // take fireflies out first
  GivenQuarters quarters = {};   // that tell them; without, the halves do
  const std::atomic<bool>* cancel = nullptr;
};

struct NforResult {
  Rgb<float> mean;
  // R_A, R_B: not filtered by step 5. Their noise is independent but for the selection, which takes the candidate that
  // is nearer to the other half: comparing R_A with B underestimates its squared error, by 10 to 55 % on synthetic
  // scenes.
  Rgb<float> half[2];
  Rgb<float> selection;  // share of k = 1, in [0, 1]
  RegressionReport report;
};

// `estimate` has a mean, halves, and a variance unless it is to come from the halves; `features` may be null. Planes of
// all sizes, finite for finite inputs. The same bits for any number of threads.
NforResult nforFilter(const Estimate& estimate, const Features* features, const NforOptions& options = {});

}  // namespace braid
