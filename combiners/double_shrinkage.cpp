// SPDX-License-Identifier: Apache-2.0
// "double-shrinkage": DSCombiner (ALGORITHMS 3) without its network. Every pixel is the precision-weighted mean of an
// unbiased image, a biased one (a photon map's or a denoiser's) and a smooth prior fitted to both; all squared errors
// are estimated from variances and halves.
//
// Lone outliers of X_u that do not contradict X_b are replaced by it first (double-shrinkage-gate; not in the paper),
// and their variance, of more than 5 deviations around, counts as 1/25: with all of it X_u would be given up for a
// whole window, and with nothing what other pixels have not met yet would be forgotten. With sppm on the six scenes
// that have photon maps, at 8 to 256 samples, the error falls from 1.23 of that of js to 0.78.
//
// Nor in the paper: a photon map's own outliers are replaced (double-shrinkage-despike), and its bias is no less than
// the halves show it (double-shrinkage-measured; unknown_bias.h). With bdpt and sppm on 14 scenes, at 8 to 128 samples,
// the error falls to 0.8 of what it is without both.
//
// Halves of the result: the half h combines X_u^h, X_b^h and the prior of half h with the weights of the result, like
// the halves of an ensemble: the weights have seen both halves. The error map is measured across the halves of the
// result; the variance of the posterior, its alternative without halves, is too small wherever an outlier lowered eta².
#include "combiners/double_shrinkage.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "combiners/despike.h"
#include "combiners/error_map.h"
#include "combiners/finite_float.h"
#include "combiners/joint_filter.h"
#include "combiners/optimised_bias.h"
#include "combiners/radiance_prior.h"
#include "combiners/regression_features.h"
#include "combiners/registry.h"
#include "combiners/shrinkage.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

const OptionInfo kPrior{"double-shrinkage-prior", 0, "0: radiance prior, 1: James-Stein's Y*, 2: none"};
const OptionInfo kStage{"double-shrinkage-stage", 2, "1: inverse squared errors only, 2: then towards the prior"};
const OptionInfo kStride{"double-shrinkage-stride", 4, "Distance of the regression models in pixels"};

const OptionInfo kOwnHalves{"double-shrinkage-own-halves", 0,
                            "1: fit the priors of the halves by their own samples alone, at three times the cost"};

const OptionInfo kGate{"double-shrinkage-gate", 1,
                       "1: replace lone outliers of the unbiased image first; 0: the paper"};

const OptionInfo kDespike{
    "double-shrinkage-despike", 1,
    "1: take out outliers of a photon map that one or two quarters alone speak for; 0: the paper"};
const OptionInfo kMeasured{
    "double-shrinkage-measured", 1,
    "1: a photon map's bias is what halves show of it, if that is more than it knows; 0: the paper"};

constexpr int kRadius = 6;  // of the filter of the biased image's variance

// a + weight (b - a), not below 0.
Rgb<float> blend(const Rgb<float>& a, const Rgb<float>& b, const Plane<float>& weight) {
  Rgb<float> out(a.width(), a.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const auto w = static_cast<double>(weight[i]);
        out[c][i] =
            finiteFloat(std::max(0.0, (1 - w) * static_cast<double>(a[c][i]) + w * static_cast<double>(b[c][i])));
      }
  });
  return out;
}

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
  return std::move(jointFilter({&sum}, features, kRadius)[0]);
}

struct Prior {
  Rgb<float> mean, half[2];
};

// The prior of all samples and those of the halves, each by a fit of its own.
Prior ownFits(const MethodInputs& in, const Rgb<float>& variance, const Rgb<float> (&stageOne)[3],
              const RegressionSettings& settings, RegressionReport& report) {
  const Estimate &x = *in.unbiased, &y = *in.biased;
  const Plane<float> noise = biasedVariance(y, in.features);
  const Rgb<float>* unbiased[3] = {&x.mean, &x.half[0], &x.half[1]};
  const Rgb<float>* biased[3] = {&y.mean, &y.half[0], &y.half[1]};
  const Samples samples[3] = {Samples::All, Samples::HalfA, Samples::HalfB};
  Prior prior;
  Rgb<float>* out[3] = {&prior.mean, &prior.half[0], &prior.half[1]};
  for (size_t k = 0; k < 3; ++k) {
    const float scale = k == 0 ? 1.0f : 2.0f;  // a half has twice the variance
    const Plane<float> ofUnbiased = channelSum(variance, static_cast<double>(scale));
    Plane<float> ofBiased = noise;
    for (float& v : ofBiased.data) v = std::min(v, std::numeric_limits<float>::max() / 2) * scale;
    const RegressionFeatures features(in.features, samples[k]);
    *out[k] = radiancePrior({unbiased[k], &ofUnbiased}, {biased[k], &ofBiased}, features.groups(), stageOne[k],
                            settings, &report);
  }
  return prior;
}

// `stageOne` holds the first shrinkage of all samples, half A and half B: what the prior falls back to.
Prior makePrior(const MethodInputs& in, const Rgb<float>& variance, const Rgb<float> (&stageOne)[3],
                MethodResult& result) {
  const Estimate &x = *in.unbiased, &y = *in.biased;
  const RegressionSettings settings =
      stridedSettings(static_cast<int>(std::clamp(in.options.number(kStride), 1.0, 64.0)), in.cancel);
  Prior prior;
  RegressionReport report;
  if (in.options.number(kPrior) == 1) {
    OptimisedBias fit = optimisedBias(x, y, in.features, settings);
    prior = {fit.mean(), {std::move(fit.own[0]), std::move(fit.own[1])}};
    report = fit.report;
  } else if (in.options.number(kOwnHalves) != 0) {
    prior = ownFits(in, variance, stageOne, settings, report);
  } else {
    const Plane<float> ofUnbiased = channelSum(variance, 1), ofBiased = biasedVariance(y, in.features);
    const RegressionFeatures features(in.features, Samples::All);
    auto [a, b] = radiancePriorHalves({&x.mean, &ofUnbiased, {&x.half[0], &x.half[1]}},
                                      {&y.mean, &ofBiased, {&y.half[0], &y.half[1]}}, features.groups(),
                                      {stageOne[1], stageOne[2]}, settings, &report);
    prior = {average(a, b), {std::move(a), std::move(b)}};
  }
  result.remarks.push_back(report.attribute("double-shrinkage-regression"));
  return prior;
}

constexpr float kOutlierVariance = 1.0f / 25;  // of the variance of an outlier that was replaced

// The mean and the halves of x without its lone outliers, whose variance is lowered.
Estimate withoutOutliers(const Estimate& x, const Estimate& y, Rgb<float>& variance) {
  const Plane<float> gate = outlierGate(variance, kGateRadius);
  Estimate out;
  out.name = x.name;
  out.passes = x.passes;
  out.mean = x.mean;
  for (int h = 0; h < 2; ++h) out.half[h] = x.half[h];
  parallelChunks(gate.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!isLoneOutlier(gate, x.mean, y.mean, i)) continue;
      for (size_t c = 0; c < 3; ++c) {
        out.mean[c][i] = y.mean[c][i];
        for (int h = 0; h < 2; ++h) out.half[h][c][i] = y.half[h][c][i];
        variance[c][i] *= kOutlierVariance;
      }
    }
  });
  return out;
}

// What is read of a photon map, without its outliers, which would be spread by a prior that is fitted to them.
Estimate withoutOutliers(const Estimate& photonMap, const GivenQuarters& quarters, const Features* features) {
  Estimate out = withoutSpikes(photonMap, quarters, features);
  out.bias = photonMap.bias;
  out.biasVariance = photonMap.biasVariance;
  return out;
}

class DoubleShrinkageMethod : public Method {
 public:
  const char* name() const override { return "double-shrinkage"; }
  const char* description() const override {
    return "Precision-weighted mean of the unbiased image, the biased one, and a smooth prior fitted to both";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = true;
    needs.features = needs.featureNoise = true;
    needs.quartersHelp = true;
    needs.passes = 4;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override { return {284 + (of.photonMap ? 48 : 0), 72}; }
  std::vector<OptionInfo> options() const override {
    return {kPrior, kStage, kStride, kOwnHalves, kGate, kDespike, kMeasured};
  }
  MethodResult run(const MethodInputs& in) const override;
};

// kappa_1, kappa_2 and the variance of the posterior of every pixel; without a prior its error is infinite.
struct Maps {
  Plane<float> toBiased, toPrior, variance;
  Maps(const Plane<float>& unbiasedError, const Plane<float>& biasedError, const Plane<float>& priorError)
      : toBiased(unbiasedError.width, unbiasedError.height), toPrior(toBiased), variance(toBiased) {
    parallelChunks(toBiased.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const double eta2 = priorError.empty() ? HUGE_VAL : static_cast<double>(priorError[i]);
        const DoubleShrinkage s =
            doubleShrinkage(static_cast<double>(unbiasedError[i]), static_cast<double>(biasedError[i]), eta2);
        toBiased[i] = static_cast<float>(s.toBiased);
        toPrior[i] = static_cast<float>(s.toPrior);
        variance[i] = finiteFloat(s.variance);
      }
    });
  }
};

MethodResult DoubleShrinkageMethod::run(const MethodInputs& given) const {
  Rgb<float> variance = meanVariance(*given.unbiased);
  MethodInputs in = given;
  Estimate clean, cleanMap;
  if (in.options.number(kDespike) != 0 && !given.biased->bias.empty()) {
    cleanMap = withoutOutliers(*given.biased, given.biasedQuarters, given.features);
    in.biased = &cleanMap;
  }
  const Estimate& y = *in.biased;
  if (in.options.number(kGate) != 0 && hasHalves(*given.unbiased) && hasHalves(y)) {
    clean = withoutOutliers(*given.unbiased, y, variance);
    in.unbiased = &clean;
  }
  const Estimate& x = *in.unbiased;
  MethodResult result;
  Estimate& out = result.image;
  out.unbiased = false;
  out.passes = x.passes;
  const bool halves = hasHalves(x) && hasHalves(y);
  Plane<float> errorU = unbiasedError(x, variance),
               errorB = biasedError(y, x, variance, in.features, in.options.number(kMeasured) != 0), errorP;
  cleanMap.bias = cleanMap.biasVariance = Rgb<float>();  // read no more
  Maps maps(errorU, errorB, errorP);
  Rgb<float> combined[3];
  combined[0] = blend(x.mean, y.mean, maps.toBiased);
  for (int h = 0; halves && h < 2; ++h) combined[h + 1] = blend(x.half[h], y.half[h], maps.toBiased);

  // Without halves nothing tells how good a prior is.
  if (halves && in.options.number(kStage) >= 2 && in.options.number(kPrior) < 2) {
    const Prior prior = makePrior(in, variance, combined, result);
    errorP = priorError(prior.mean, prior.half, x, variance, errorU);
    maps = Maps(errorU, errorB, errorP);
    combined[0] = blend(combined[0], prior.mean, maps.toPrior);
    for (int h = 0; h < 2; ++h) combined[h + 1] = blend(combined[h + 1], prior.half[h], maps.toPrior);
    const char* const channels[3] = {"R", "G", "B"};
    for (size_t c = 0; c < 3; ++c)
      result.aovs.push_back({std::string("prior.double-shrinkage.") + channels[c], prior.mean[c]});
    result.aovs.push_back({"eta2.double-shrinkage", std::move(errorP)});
  }
  out.mean = std::move(combined[0]);
  for (int h = 0; h < 2; ++h) out.half[h] = std::move(combined[h + 1]);
  result.aovs.push_back({"kappa1.double-shrinkage", std::move(maps.toBiased)});
  result.aovs.push_back({"kappa2.double-shrinkage", std::move(maps.toPrior)});
  result.aovs.push_back({"error-unbiased.double-shrinkage", std::move(errorU)});
  result.aovs.push_back({"error-biased.double-shrinkage", std::move(errorB)});
  result.error =
      halves ? errorMap(out.half, *given.unbiased, meanVariance(*given.unbiased), out.mean) : std::move(maps.variance);
  return result;
}

}  // namespace

std::unique_ptr<Method> make_double_shrinkage() { return std::make_unique<DoubleShrinkageMethod>(); }

}  // namespace braid
