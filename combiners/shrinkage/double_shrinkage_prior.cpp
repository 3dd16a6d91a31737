// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/double_shrinkage_prior.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "combiners/pixels/finite_float.h"
#include "combiners/regression/regression_features.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/regression/radiance_prior.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/statistics/surface_smooth.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 6;  // of the filter of the biased image's variance

Plane<float> channelSum(const Rgb<float>& image, double scale) {
  Plane<float> out(image.width(), image.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = finiteFloat(scale * (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) +
                                    static_cast<double>(image[2][i])));
  });
  return out;
}

// Variance of the biased image for the weights of the prior. A denoiser brings none; (A - B)² / 4 has one degree of
// freedom a pixel and is smoothed.
Plane<float> biasedVariance(const Estimate& biased, const Features* features) {
  Plane<float> sum = channelSum(meanVariance(biased), 1);
  if (!biased.variance.empty()) return sum;
  return std::move(surfaceSmooth({&sum}, features, kRadius)[0]);
}

// The prior of all samples and those of the halves, each by a fit of its own. No pixel of the mean is made of the
// halves' priors, which measure how good the prior is: their models may stand twice as far apart
// (combiners/EXPERIMENTS.md, Models of the halves' priors).
Estimate ownFits(const MethodInputs& in, const PriorInput& of, const Estimate& first, int stride,
                 RegressionReport& report) {
  const Estimate &x = *of.x, &y = *in.biased;
  const Plane<float> noise = biasedVariance(y, in.features);
  const auto fit = [&](const Rgb<float>& unbiased, const Rgb<float>& biased, const Rgb<float>& fallback,
                       Samples samples) {
    const float scale = samples == Samples::All ? 1.0f : 2.0f;  // a half has twice the variance
    const Plane<float> ofUnbiased = channelSum(*of.variance, static_cast<double>(scale));
    Plane<float> ofBiased = noise;
    for (float& v : ofBiased.data) v = std::min(v, std::numeric_limits<float>::max() / 2) * scale;
    const RegressionFeatures features(in.features, samples);
    const RegressionSettings settings = stridedSettings(samples == Samples::All ? stride : 2 * stride, in.cancel);
    return radiancePrior({&unbiased, &ofUnbiased}, {&biased, &ofBiased}, features.groups(), fallback, settings,
                         &report);
  };
  Estimate prior;
  prior.mean = fit(x.mean, y.mean, first.mean, Samples::All);
  prior.half[0] = fit(x.half[0], y.half[0], first.half[0], Samples::HalfA);
  prior.half[1] = fit(x.half[1], y.half[1], first.half[1], Samples::HalfB);
  return prior;
}

// The priors of the halves with weights from all samples.
Estimate sharedFits(const MethodInputs& in, const PriorInput& of, const Estimate& first,
                    const RegressionSettings& settings, RegressionReport& report) {
  const Estimate &x = *of.x, &y = *in.biased;
  const Plane<float> ofUnbiased = channelSum(*of.variance, 1), ofBiased = biasedVariance(y, in.features);
  const RegressionFeatures features(in.features, Samples::All);
  auto halves = radiancePriorHalves({&x.mean, &ofUnbiased, {&x.half[0], &x.half[1]}},
                                    {&y.mean, &ofBiased, {&y.half[0], &y.half[1]}}, features.groups(),
                                    {first.half[0], first.half[1]}, settings, &report);
  Estimate prior;
  prior.mean = average(halves[0], halves[1]);
  for (size_t h = 0; h < 2; ++h) prior.half[h] = std::move(halves[h]);
  return prior;
}

}  // namespace

Estimate doubleShrinkagePrior(const MethodInputs& in, const PriorInput& of, const Estimate& first,
                              const PriorChoice& choice, RegressionReport& report) {
  const RegressionSettings settings = stridedSettings(choice.stride, in.cancel);
  if (!choice.optimisedBias)
    return choice.ownHalves ? ownFits(in, of, first, choice.stride, report)
                            : sharedFits(in, of, first, settings, report);
  OptimisedBias fit = optimisedBias(*of.x, *in.biased, in.features, settings);
  Estimate prior;
  prior.mean = fit.mean();
  for (int h = 0; h < 2; ++h) prior.half[h] = std::move(fit.own[h]);
  report = fit.report;
  return prior;
}

}  // namespace braid
