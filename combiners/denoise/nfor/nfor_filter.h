// SPDX-License-Identifier: Apache-2.0
// NFOR (Bitterli et al. 2016): colours are fitted as linear functions of prefiltered features with non-local means
// weights, and all pixels of a window receive a model's prediction. The five steps stand in combiners/README.md, NFOR.
//
// Fireflies that one half, or two quarters, alone speak for may be taken out first (fireflies.h): a regression smears
// them over its window, and neither their variance nor the other half keeps it from that. What is not in the paper can
// be turned off, but for the range that fits are kept in (local_range_clamp.h). Smaller ridges than 10⁻³ of the mean
// diagonal, on features scaled to the window (regression.h), fit noise.
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
  GivenQuarters quarters = {};   // that show them; without, the halves do
  const std::atomic<bool>* cancel = nullptr;
};

struct NforResult {
  Rgb<float> mean;
  // R_A, R_B: not filtered by step 5. Their noise is independent but for the selection, which takes the candidate that
  // is nearer to the other half: comparing R_A with B underestimates its squared error.
  Rgb<float> half[2];
  Rgb<float> selection;  // share of k = 1, in [0, 1]
  RegressionReport report;
};

// `estimate` has a mean, halves, and a variance unless it is to come from the halves; `features` may be null. Planes of
// all sizes, finite for finite inputs. The same bits for any number of threads.
NforResult nforFilter(const Estimate& estimate, const Features* features, const NforOptions& options = {});

}  // namespace braid
