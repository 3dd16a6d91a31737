// SPDX-License-Identifier: Apache-2.0
#include "combiners/curves/sure_blend.h"

#include <algorithm>

#include "combiners/statistics/half_statistics.h"
#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

OptionInfo sureStepOption(const std::string& method) {
  return {
      method + "-step", 0.1, "Perturbation of the risk estimate in standard deviations of a pixel", 0.001, 10, false};
}

SureMaps denoisedSureMaps(const MethodInputs& in, const Estimate& n, const OptionInfo& step) {
  if (!in.redenoise) throw Error(ExitCode::Usage, "needs a denoiser that it can run again as its biased input");
  return sureMaps(n.mean, in.biased->mean, n.variance, in.seed, std::clamp(in.options.number(step), 1e-3, 10.0),
                  in.redenoise);
}

SureBlend::SureBlend(const MethodInputs& in)
    : noisy(*in.unbiased),
      denoised(*in.biased),
      halves(hasHalves(noisy) && hasHalves(denoised)),
      share(noisy.mean.width(), noisy.mean.height()) {
  result.image.mean = Rgb<float>(share.width, share.height);
  if (halves) result.image.half[0] = result.image.half[1] = Rgb<float>(share.width, share.height);
  result.error = Plane<float>(share.width, share.height);
}

MethodResult SureBlend::finish(const std::string& method, double filterSigma) {
  result.aovs.push_back({"weight." + method, std::move(share)});
  result.remarks.push_back(numberAttribute("sureMapFilterSigma", filterSigma));
  return std::move(result);
}

}  // namespace braid
