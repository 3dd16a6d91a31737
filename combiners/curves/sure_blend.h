// SPDX-License-Identifier: Apache-2.0
// What methods share that blend a noisy image with its denoised one by Stein's unbiased risk estimate.
#pragma once

#include <string>

#include "combiners/method.h"
#include "combiners/statistics/sure_map.h"

namespace braid {

// The perturbation of the risk estimate: the option "<method>-step".
OptionInfo sureStepOption(const std::string& method);

// The maps of the denoised image of n. Throws Error(Usage) where the denoiser cannot be run again.
SureMaps denoisedSureMaps(const MethodInputs& in, const Estimate& n, const OptionInfo& step);

// The result so far: black images, with halves where both inputs have them, which take the choices of the whole image.
struct SureBlend {
  explicit SureBlend(const MethodInputs& in);

  // Of one pixel and channel: mix(noisy value, denoised value).
  template <class Mix>
  void set(size_t c, size_t i, const Mix& mix) {
    result.image.mean[c][i] = mix(noisy.mean[c][i], denoised.mean[c][i]);
    for (int h = 0; halves && h < 2; ++h) result.image.half[h][c][i] = mix(noisy.half[h][c][i], denoised.half[h][c][i]);
  }
  // With the map of weights `share` and how the maps were filtered.
  MethodResult finish(const std::string& method, double filterSigma);

  const Estimate &noisy, &denoised;
  bool halves;
  MethodResult result;
  Plane<float> share;
};

}  // namespace braid
