// SPDX-License-Identifier: Apache-2.0
// "double-shrinkage": DSCombiner (combiners/README.md, Double shrinkage) without its network. Every pixel is the
// precision-weighted mean of an unbiased image, a biased one (a photon map's or a denoiser's) and a smooth prior fitted
// to both; all squared errors are estimated from variances and halves. Options bring the paper back; what they gain:
// combiners/EXPERIMENTS.md, Priors beside photon maps; Lone fireflies first; Correcting photon maps by their own bias.
//
// Half h of the result combines X_u^h, X_b^h and the prior of half h, fitted to that half alone, with the weights of
// the result, which have seen both halves. The error map is measured across the halves; the variance of the posterior,
// its alternative without halves, is too small wherever a firefly lowered eta².
#include "combiners/shrinkage/double_shrinkage.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "combiners/shrinkage/debias.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/surface_smooth.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/shrinkage/radiance_prior.h"
#include "combiners/regression/regression_features.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/shrinkage/shrinkage.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

const OptionInfo kPrior{"double-shrinkage-prior", 0, "0: radiance prior, 1: James-Stein's Y*, 2: none", 0, 2};
const OptionInfo kStage{"double-shrinkage-stage", 2, "1: inverse squared errors only, 2: then towards the prior", 1, 2};
const OptionInfo kStride{"double-shrinkage-stride", 4, "Distance of the regression models in pixels", 1, 64};

const OptionInfo kOwnHalves{"double-shrinkage-own-halves", 1,
                            "1: fit the priors of the halves by their own samples alone; 0: weights from all samples"};

const OptionInfo kGate{"double-shrinkage-gate", 1,
                       "1: replace lone fireflies of the unbiased image first; 0: the paper"};

const OptionInfo kFireflies{
    "double-shrinkage-remove-fireflies", 1,
    "1: take out fireflies of a photon map that one or two quarters alone speak for; 0: the paper"};
const OptionInfo kDebias{"double-shrinkage-debias", 1,
                         "1: take the bias from a photon map that it tells; 0: the paper"};
const OptionInfo kMeasured{
    "double-shrinkage-measured", 1,
    "1: a photon map's bias, and light that the unbiased image lacks, are what they show to be; 0: the paper"};
const OptionInfo kFused{"double-shrinkage-fused", 1,
                        "1: fit the prior to the photon map where that is far better, and measure it so; 0: the paper"};
const OptionInfo kChosen{"double-shrinkage-chosen", 1,
                         "1: take the prior where halves show it to be of use; 0: everywhere (paper)"};

constexpr int kRadius = 6;        // of the filter of the biased image's variance
constexpr int kChoiceRadius = 7;  // of the patches that show whether the prior is of use

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
  return std::move(surfaceSmooth({&sum}, features, kRadius)[0]);
}

// Of both images by their weights: means, halves where there are any, and the variance of the mean.
Estimate meanOf(const Estimate& x, const Rgb<float>& variance, const Estimate& y, const Plane<float>& toBiased) {
  Estimate out;
  out.passes = x.passes;
  out.mean = blend(x.mean, y.mean, toBiased);
  if (!hasHalves(x) || !hasHalves(y)) return out;
  for (int h = 0; h < 2; ++h) out.half[h] = blend(x.half[h], y.half[h], toBiased);
  out.variance = meanVariance(y);
  parallelChunks(toBiased.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const auto k = static_cast<double>(toBiased[i]);
        out.variance[c][i] = finiteFloat(sqr(1 - k) * static_cast<double>(variance[c][i]) +
                                         sqr(k) * static_cast<double>(out.variance[c][i]));
      }
  });
  return out;
}

Plane<float> fourthPower(const Plane<float>& in) {
  Plane<float> out = in;
  for (float& v : out.data) v = sqr(sqr(v));
  return out;
}

// The squared error of x + share (y - x) from those of x and y, which are independent.
Plane<float> errorOfMean(const Plane<float>& ofX, const Plane<float>& ofY, const Plane<float>& share) {
  Plane<float> out(share.width, share.height);
  for (size_t i = 0; i < out.size(); ++i)
    out[i] = finiteFloat(sqr(1 - static_cast<double>(share[i])) * static_cast<double>(ofX[i]) +
                         sqr(static_cast<double>(share[i])) * static_cast<double>(ofY[i]));
  return out;
}

// What the prior is fitted to beside the biased image, its variance and its squared error.
struct PriorInput {
  const Estimate* x;
  const Rgb<float>* variance;
  Plane<float> error;
};

// The prior of all samples and those of the halves, each by a fit of its own. `first` is the first shrinkage: what the
// prior falls back to. No pixel of the mean is made of the halves' priors, which measure how good the prior is: their
// models may stand twice as far apart (combiners/EXPERIMENTS.md, Models of the halves' priors).
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

Estimate makePrior(const MethodInputs& in, const PriorInput& of, const Estimate& first, MethodResult& result) {
  const Estimate &x = *of.x, &y = *in.biased;
  const int stride = static_cast<int>(std::clamp(in.options.number(kStride), 1.0, 64.0));
  const RegressionSettings settings = stridedSettings(stride, in.cancel);
  Estimate prior;
  RegressionReport report;
  if (in.options.number(kPrior) == 1) {
    OptimisedBias fit = optimisedBias(x, y, in.features, settings);
    prior.mean = fit.mean();
    for (int h = 0; h < 2; ++h) prior.half[h] = std::move(fit.own[h]);
    report = fit.report;
  } else if (in.options.number(kOwnHalves) != 0) {
    prior = ownFits(in, of, first, stride, report);
  } else {
    const Plane<float> ofUnbiased = channelSum(*of.variance, 1), ofBiased = biasedVariance(y, in.features);
    const RegressionFeatures features(in.features, Samples::All);
    auto halves = radiancePriorHalves({&x.mean, &ofUnbiased, {&x.half[0], &x.half[1]}},
                                      {&y.mean, &ofBiased, {&y.half[0], &y.half[1]}}, features.groups(),
                                      {first.half[0], first.half[1]}, settings, &report);
    prior.mean = average(halves[0], halves[1]);
    for (size_t h = 0; h < 2; ++h) prior.half[h] = std::move(halves[h]);
  }
  result.remarks.push_back(report.attribute("double-shrinkage-regression"));
  return prior;
}

constexpr float kFireflyVariance = 1.0f / 25;  // of the variance of a firefly that was replaced

// The mean and the halves of x without its lone fireflies, whose variance is lowered.
Estimate withoutFireflies(const Estimate& x, const Estimate& y, Rgb<float>& variance) {
  const Plane<float> gate = fireflyGate(variance, kGateRadius);
  Estimate out;
  out.name = x.name;
  out.passes = x.passes;
  out.mean = x.mean;
  for (int h = 0; h < 2; ++h) out.half[h] = x.half[h];
  parallelChunks(gate.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      if (!isLoneFirefly(gate, x.mean, y.mean, i)) continue;
      for (size_t c = 0; c < 3; ++c) {
        out.mean[c][i] = y.mean[c][i];
        for (int h = 0; h < 2; ++h) out.half[h][c][i] = y.half[h][c][i];
        variance[c][i] *= kFireflyVariance;
      }
    }
  });
  return out;
}

// What is read of a photon map: corrected by its own bias estimate, and without its fireflies, which a prior that is
// fitted to them would spread.
Estimate prepared(const MethodInputs& in) {
  Estimate map = in.options.number(kDebias) != 0 ? debiased(*in.biased) : *in.biased;
  if (in.options.number(kFireflies) == 0) return map;
  Estimate out = withoutFireflies(map, in.biasedQuarters, in.features);
  out.bias = std::move(map.bias);
  out.biasVariance = std::move(map.biasVariance);
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
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.helpful.quarters = true;
    needs.passes = 4;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override { return {284 + (of.photonMap ? 108 : 0), 72}; }
  std::vector<OptionInfo> options() const override {
    return {kPrior, kStage, kStride, kOwnHalves, kGate, kDebias, kFireflies, kMeasured, kFused, kChosen};
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

// The second shrinkage.
Estimate towards(const Estimate& prior, const Estimate& first, const Plane<float>& toPrior) {
  Estimate out;
  out.passes = first.passes;
  out.unbiased = false;
  out.mean = blend(first.mean, prior.mean, toPrior);
  for (int h = 0; h < 2; ++h) out.half[h] = blend(first.half[h], prior.half[h], toPrior);
  return out;
}

// The second shrinkage where it is nearer to the other half of the first one than that is itself, by weights.
void chooseBetween(Estimate& second, const Estimate& first, const Features* features) {
  const std::vector<const Estimate*> both = {&second, &first};
  const WeightMaps weights = relativeWeights(first, both, second.mean, first.variance, features, kChoiceRadius);
  Estimate chosen = weightedEstimate(weights, both);
  second.mean = std::move(chosen.mean);
  for (int h = 0; h < 2; ++h) second.half[h] = std::move(chosen.half[h]);
}

// The error map of a combination with a photon map, measured across the halves of the first shrinkage, which lacks less
// light than the unbiased image, plus what the photon map says of its bias, which all halves share.
Plane<float> estimatedError(const Estimate& out, const Estimate& first, const Plane<float>& toBiased,
                            Plane<float>& squaredBias) {
  Plane<float> error = errorMap(out.half, first, first.variance, out.mean);
  for (size_t i = 0; i < error.size(); ++i) squaredBias[i] *= toBiased[i] * toBiased[i];
  const Plane<float> bias = smoothedSquaredBias(squaredBias, out.mean);
  for (size_t i = 0; i < error.size(); ++i)
    error[i] = finiteFloat(static_cast<double>(error[i]) + static_cast<double>(bias[i]));
  return error;
}

MethodResult DoubleShrinkageMethod::run(const MethodInputs& given) const {
  Rgb<float> variance = meanVariance(*given.unbiased);
  MethodInputs in = given;
  Estimate clean, cleanMap;
  if (!given.biased->bias.empty()) {
    cleanMap = prepared(given);
    in.biased = &cleanMap;
  }
  const Estimate& y = *in.biased;
  if (in.options.number(kGate) != 0 && hasHalves(*given.unbiased) && hasHalves(y)) {
    clean = withoutFireflies(*given.unbiased, y, variance);
    in.unbiased = &clean;
  }
  const Estimate& x = *in.unbiased;
  const bool halves = hasHalves(x) && hasHalves(y), measured = in.options.number(kMeasured) != 0;
  Plane<float> errorU = unbiasedError(x, variance), errorB = biasedError(y, x, variance, in.features, measured), errorP;
  if (measured && !y.bias.empty()) countMissingLight(errorU, x, variance, y, errorB);
  Plane<float> squaredBias;
  if (!y.bias.empty()) squaredBias = squaredBiasSamples(y);
  cleanMap.bias = cleanMap.biasVariance = Rgb<float>();  // read no more
  Maps maps(errorU, errorB, errorP);
  MethodResult result;
  Estimate& out = result.image;
  out = meanOf(x, variance, y, maps.toBiased);
  out.unbiased = false;

  // Without halves nothing shows how good a prior is.
  if (halves && in.options.number(kStage) >= 2 && in.options.number(kPrior) < 2) {
    const Estimate first = std::move(out);
    PriorInput of = {&x, &variance, errorU};
    Estimate trusted;
    if (in.options.number(kFused) != 0 && !squaredBias.empty()) {
      const Plane<float> share = fourthPower(maps.toBiased);
      trusted = meanOf(x, variance, y, share);
      of = {&trusted, &trusted.variance, errorOfMean(errorU, errorB, share)};
    }
    Estimate prior = makePrior(in, of, first, result);
    errorP = priorError(prior.mean, prior.half, *of.x, *of.variance, of.error);
    maps = Maps(errorU, errorB, errorP);
    out = towards(prior, first, maps.toPrior);
    if (in.options.number(kChosen) != 0) chooseBetween(out, first, in.features);
    if (!squaredBias.empty()) result.error = estimatedError(out, first, maps.toBiased, squaredBias);
    const char* const channels[3] = {"R", "G", "B"};
    for (size_t c = 0; c < 3; ++c)
      result.aovs.push_back({std::string("prior.double-shrinkage.") + channels[c], std::move(prior.mean[c])});
    result.aovs.push_back({"eta2.double-shrinkage", std::move(errorP)});
  }
  out.variance = Rgb<float>();  // it is not that of the prior's part
  result.aovs.push_back({"kappa1.double-shrinkage", std::move(maps.toBiased)});
  result.aovs.push_back({"kappa2.double-shrinkage", std::move(maps.toPrior)});
  result.aovs.push_back({"error-unbiased.double-shrinkage", std::move(errorU)});
  result.aovs.push_back({"error-biased.double-shrinkage", std::move(errorB)});
  if (result.error.empty())
    result.error = halves ? errorMap(out.half, *given.unbiased, meanVariance(*given.unbiased), out.mean)
                          : std::move(maps.variance);
  return result;
}

}  // namespace

std::unique_ptr<Method> make_double_shrinkage() { return std::make_unique<DoubleShrinkageMethod>(); }

}  // namespace braid
