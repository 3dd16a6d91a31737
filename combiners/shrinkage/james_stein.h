// SPDX-License-Identifier: Apache-2.0
// James-Stein as a method ("js"), and what a network may say in the place of its box filter and of alpha = 1/2
// ("js-neural"; combiners/README.md, James-Stein).
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "combiners/method.h"
#include "combiners/shrinkage/shrinkage.h"

namespace braid {

// One of the three images that are shrunk: those of the halves, then that of all samples.
struct ShrinkageImages {
  const Rgb<float>& x;         // unbiased
  const Rgb<float>& variance;  // of its mean
  const NoiseScale& scale;     // which of its pixels are lone fireflies
  const Rgb<float>& target;    // Y*
  const Rgb<float>& fits;      // what the fit of X_A has more than that of X_B; or empty
  const LeastFactors* least;   // or null
  bool half;
};

struct LearnedShrinkage {
  std::array<Plane<float>, 3> variance;  // sigma_c² of the block about every pixel
  Plane<float> blend;                    // alpha: the share of the fit of X_A in Y*
};

using ShrinkageModel = std::function<LearnedShrinkage(const ShrinkageImages&)>;

// Without a model: js. With one, the options that say how js makes up for it are not read.
MethodResult runJamesStein(const MethodInputs& in, const ShrinkageModel* model);

MethodMemory jamesSteinMemory(const MemoryCase& of);
Needs jamesSteinNeeds();
// Those that are read with a model as well.
std::vector<OptionInfo> commonJamesSteinOptions();

}  // namespace braid
