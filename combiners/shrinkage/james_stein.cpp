// SPDX-License-Identifier: Apache-2.0
// "js": the James-Stein combiner (combiners/README.md, James-Stein) without the network of the paper: variances are box
// averages and alpha is 1/2. The unbiased image is pulled, block by block, towards a biased image that was first fitted
// to it by a crossed half-buffer regression.
//
// It promises never to be worse than the unbiased image where the noise of a block is even and the biased image does
// not depend on it. Lone fireflies, fits only where they help, measured factors and own halves keep nearer to that
// (combiners/EXPERIMENTS.md, Gating James-Stein; Fits only where they help; Measured factors of James-Stein; Own halves
// of RDFC).
//
// Half h of the result is JS(X^h, its variance, own fit of half h): the halves share weights over windows but no pixel
// values, so that errors can be measured across them. With js-crossed they depend on each other: no error map.
#include "combiners/shrinkage/james_stein.h"

#include <utility>

#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/shrinkage/cross_half_shrinkage.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kConstant{
    "js-constant", 1, "Shrinkage relative to the papers' p - 2; below 2, it beats the unbiased image", 0, 100, false};
const OptionInfo kRegression{
    "js-regression", 2, "Fit the biased image to the unbiased one first: 0 no, 1 yes (the paper), 2 where it helps", 0,
    2};
const OptionInfo kVariance{"js-variance", 0, "Variance of a block: 0 box, 1 Gaussian, 2 robust, 3 whitened", 0, 3};
const OptionInfo kSigma{"js-sigma", 3,  "Standard deviation of the Gaussian filter of the variance in pixels",
                        0.1,        50, false};
const OptionInfo kCrossed{"js-crossed", 0, "1: combine each half with the fit of the other one, then average"};
const OptionInfo kGlobal{"js-global", 0, "1: one factor for the whole image"};
const OptionInfo kPositivePart{"js-positive-part", 1, "0: let factors be negative"};
const OptionInfo kStride{"js-stride", 4, "Distance of the regression models in pixels", 1, 64};
const OptionInfo kGate{
    "js-gate", 1, "1: replace lone fireflies of the unbiased image first, as far as its halves do not agree on them"};
const OptionInfo kMeasured{"js-measured", 1,
                           "1: keep as much of the unbiased image as its halves ask for at least; 0: the paper"};
const OptionInfo kOwnHalves{"js-own-halves", 1,
                            "1: where the denoiser's halves share weights, denoise each half by itself; 0: the paper"};

constexpr int kChoiceRadius = 7;  // of the patches that show whether the fit helps

// The images that X, X^A and X^B are pulled towards, and by how much of the fit of X^A the first one could be more.
struct Targets {
  Rgb<float> mean, half[2], crossed[2], fits;
};

class JamesStein : public Method {
 public:
  const char* name() const override { return "js"; }
  const char* description() const override {
    return "James-Stein shrinkage of the unbiased image, in blocks, towards a fit of the biased one";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return jamesSteinNeeds(); }
  MethodMemory memory(const MemoryCase& of) const override { return jamesSteinMemory(of); }
  std::vector<OptionInfo> options() const override {
    return {kConstant,     kRegression, kVariance, kSigma,    kCrossed,  kGlobal,
            kPositivePart, kStride,     kGate,     kMeasured, kOwnHalves};
  }
  MethodResult run(const MethodInputs& in) const override { return runJamesStein(in, nullptr); }
};

JamesSteinSettings settingsOf(const MethodOptions& o, bool learned) {
  JamesSteinSettings s;
  s.constant = std::max(0.0, o.number(kConstant));
  s.gate = o.number(kGate) != 0;
  if (learned) return s;
  constexpr VarianceFilter kFilters[] = {VarianceFilter::Box, VarianceFilter::Gaussian, VarianceFilter::Robust,
                                         VarianceFilter::Whitened};
  s.filter = kFilters[static_cast<int>(std::clamp(o.number(kVariance), 0.0, 3.0))];
  s.sigma = o.number(kSigma);
  s.global = o.number(kGlobal) != 0;
  s.positivePart = o.number(kPositivePart) != 0;
  return s;
}

// The fit where it is nearer to the other half than Y itself, by weights.
void chooseBetween(const Estimate& x, const Estimate& y, const Rgb<float>& variance, const Features* features,
                   Targets& t) {
  Estimate fit;
  fit.mean = std::move(t.mean);
  for (int h = 0; h < 2; ++h) fit.half[h] = std::move(t.half[h]);
  const std::vector<const Estimate*> bases = {&fit, &y};
  const WeightMaps weights = relativeWeights(x, bases, y.mean, variance, features, kChoiceRadius);
  Estimate chosen = weightedEstimate(weights, bases);
  t.mean = std::move(chosen.mean);
  for (int h = 0; h < 2; ++h) {
    t.half[h] = std::move(chosen.half[h]);
    t.crossed[h] = weightedImage(weights, {&t.crossed[h], &y.half[h]});
  }
  if (t.fits.empty()) return;
  const Rgb<float> nothing(x.mean.width(), x.mean.height());
  t.fits = weightedImage(weights, {&t.fits, &nothing});
}

// The biased image with halves that carry nothing of each other's noise.
Estimate withOwnHalves(const MethodInputs& in) {
  Estimate y;
  for (int h = 0; h < 2; ++h) y.half[h] = in.denoiseHalf(h);
  y.mean = in.biased->mean;
  return y;
}

// a + scale b
Rgb<float> sumOf(Rgb<float> a, const Rgb<float>& b, const std::function<float(size_t)>& scale) {
  parallelChunks(a.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i)
        a[c][i] =
            finiteFloat(static_cast<double>(a[c][i]) + static_cast<double>(scale(i)) * static_cast<double>(b[c][i]));
  });
  return a;
}

// With `keepFits` the difference of the fits, too.
Targets targetsOf(const MethodInputs& in, const Estimate& y, const Rgb<float>& variance, bool keepFits,
                  MethodResult& result) {
  const Estimate& x = *in.unbiased;
  Targets t;
  if (!hasHalves(x) || !hasHalves(y) || in.options.number(kRegression) == 0) {
    t.mean = y.mean;
    for (int h = 0; h < 2; ++h) t.half[h] = t.crossed[h] = y.half[h];
    return t;
  }
  const RegressionSettings settings =
      stridedSettings(static_cast<int>(std::clamp(in.options.number(kStride), 1.0, 64.0)), in.cancel);
  OptimisedBias fit = optimisedBias(x, y, in.features, settings);
  t.mean = fit.mean();
  if (keepFits) t.fits = sumOf(fit.crossed[0], fit.crossed[1], [](size_t) { return -1.0f; });
  for (int h = 0; h < 2; ++h) {
    t.half[h] = std::move(fit.own[h]);
    t.crossed[h] = std::move(fit.crossed[h]);
  }
  if (in.options.number(kRegression) == 2) chooseBetween(x, y, variance, in.features, t);
  result.remarks.push_back(fit.report.attribute("js-regression"));
  return t;
}

// By a network: Y* gets as much of either fit as it says, and blocks the noise that it says.
ShrunkImage shrunkByModel(const ShrinkageModel& model, const ShrinkageImages& of, const JamesSteinSettings& settings) {
  LearnedShrinkage learned = model(of);
  NoiseScale scale;
  scale.gate = of.scale.gate;
  scale.blocks = std::move(learned.variance);
  if (of.fits.empty()) return jamesStein(of.x, of.variance, scale, of.target, settings, of.least);
  const Rgb<float> target = sumOf(of.target, of.fits, [&](size_t i) { return learned.blend[i] - 0.5f; });
  return jamesStein(of.x, of.variance, scale, target, settings, of.least);
}

}  // namespace

MethodResult runJamesStein(const MethodInputs& in, const ShrinkageModel* model) {
  const Estimate& x = *in.unbiased;
  const bool denoiseHalves = in.denoiseHalf && in.options.number(kOwnHalves) != 0;
  const Estimate own = denoiseHalves ? withOwnHalves(in) : Estimate{};
  const Estimate& y = denoiseHalves ? own : *in.biased;
  MethodResult result;
  Estimate& out = result.image;
  out.unbiased = false;
  out.passes = x.passes;
  if (x.passes == 1) {  // nothing is known of the noise
    out.mean = y.mean;
    for (int h = 0; h < 2; ++h) out.half[h] = y.half[h];
    return result;
  }
  const JamesSteinSettings settings = settingsOf(in.options, model != nullptr);
  const bool halves = hasHalves(x) && hasHalves(y), crossed = !model && halves && in.options.number(kCrossed) != 0;
  const Rgb<float> variance = meanVariance(x);
  const Targets targets = targetsOf(in, y, variance, model != nullptr, result);
  const NoiseScale scale = noiseScale(variance, settings);
  LeastFactors least;
  const bool measured = halves && settings.positivePart && !settings.global && in.options.number(kMeasured) != 0;
  if (measured) {
    least.blocks = crossHalfShrinkage(x, targets.half, scale.gate, settings.radius);
    if (settings.gate) least.fireflies = crossHalfFireflyShrinkage(x, targets.half, scale.gate, settings.radius);
  }
  const auto shrink = [&](const ShrinkageImages& of) {
    return model ? shrunkByModel(*model, of, settings)
                 : jamesStein(of.x, of.variance, of.scale, of.target, settings, of.least);
  };
  const LeastFactors* const floor = measured ? &least : nullptr;
  ShrunkImage shrunk[2];
  for (int h = 0; halves && h < 2; ++h) {
    const Rgb<float> noise = halfVariance(x, variance, h);
    shrunk[h] = shrink({x.half[h],
                        noise,
                        noiseScale(noise, settings),
                        crossed ? targets.crossed[1 - h] : targets.half[h],
                        {},
                        floor,
                        true});
    out.half[h] = shrunk[h].image;
  }
  ShrunkImage full = crossed
                         ? ShrunkImage{average(out.half[0], out.half[1]), average(shrunk[0].factor, shrunk[1].factor)}
                         : shrink({x.mean, variance, scale, targets.mean, targets.fits, floor, false});
  out.mean = std::move(full.image);
  if (halves && !crossed) result.error = crossHalfErrorMap(out.half, x, variance, out.mean);
  const char* const channels[3] = {"R", "G", "B"};
  for (size_t c = 0; c < 3; ++c)
    result.aovs.push_back(
        {std::string(model ? "shrinkage.js-neural." : "shrinkage.js.") + channels[c], std::move(full.factor[c])});
  result.remarks.push_back(numberAttribute(kConstant.name, settings.constant));
  return result;
}

Needs jamesSteinNeeds() {
  Needs needs;
  needs.biased = true;
  needs.helpful.features = needs.helpful.featureNoise = true;
  needs.passes = 4;
  return needs;
}

MethodMemory jamesSteinMemory(const MemoryCase& of) {
  if (of.denoiseHalf) return {244, 52, 0, 12};
  return {208, 52};
}

std::vector<OptionInfo> commonJamesSteinOptions() {
  return {kConstant, kRegression, kStride, kGate, kMeasured, kOwnHalves};
}

std::unique_ptr<Method> make_js() { return std::make_unique<JamesStein>(); }

}  // namespace braid
