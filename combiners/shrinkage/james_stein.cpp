// SPDX-License-Identifier: Apache-2.0
// "js": the James-Stein combiner (Gu et al. 2022; ALGORITHMS 1) without its network: variances are box averages and
// alpha is 1/2. The unbiased image is pulled, block by block, towards a biased image that was first fitted to it by a
// crossed half-buffer regression.
//
// The paper counts on its never being worse than the unbiased image, which holds where the noise of a block is even and
// the biased image does not depend on it. Four things keep nearer to that; the first two in numbers of cases out of 56
// (14 scenes at 8 to 256 samples) that are worse than the unbiased image, and the mean gain:
//   - Lone fireflies are replaced first (js-gate): towards pw 5 cases, 1.3x at worst, and a gain of 5.6, instead of 11,
//     8.9x and 4.1.
//   - Where a denoiser has kept what it could not tell from noise, a fit to it follows that noise and hides it from the
//     factor; elsewhere it mends what the denoiser did. So the fit is taken where it is nearer to the other half of the
//     samples than the biased image itself (js-regression 2; relative_weights.h): towards pw 0 cases and a gain of 6.3
//     instead of 3 and 5.6, rdfc 2 (1.07x) and 7.2 instead of 4 (1.3x) and 6.3, box 6 and 5.8 as before.
//   - The factor is never below the one that the halves measure (js-measured; measured_factors.h): on glossy
//     plates, towards box, 0.84 of the unbiased image's error at 32 samples instead of 3.7, 0.91 at 128 instead
//     of 2.2. Lone fireflies have a factor of their own: a lamp's mirror image agrees with itself in both halves, where
//     it was replaced, and so do its neighbours; on the plates 0.98 at 64 and at 128 samples instead of 1.10 and 1.09,
//     0.99 of before on 14 scenes at 8, 32 and 128.
//   - Halves that a denoiser filtered with the weights of all samples hide their noise from all of the above. Where the
//     quarters allow it, it is run again on each half by itself (js-own-halves): towards rdfc, which that takes twice
//     more, 0.95 of the unbiased image's error on leaves at 128 samples instead of 1.03, and 0.98 of before on 14
//     scenes.
// A constant of 1.25 is a little worse in all of these than the paper's 1.
//
// Halves of the result. With js-regression the half h is JS(X^h, its variance, own fit of half h): the halves share the
// bandwidth kappa and the variance of all samples, but no pixel values, so that errors can be measured across them.
// Their mean is not the result, whose Y* is crossed and whose factors come from all samples. Without js-regression half
// h is JS(X^h, its variance, Y^h). What halves share beside that are weights and factors over windows: those of the
// choice of the fit, and the measured factors. With js-crossed the result is the mean of its halves JS(X^A, Ŷ^B) and
// JS(X^B, Ŷ^A), which depend on each other: there is no error map then.
#include <utility>

#include "combiners/statistics/half_statistics.h"
#include "combiners/shrinkage/cross_half_shrinkage.h"
#include "combiners/shrinkage/optimised_bias.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/shrinkage/shrinkage.h"

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

constexpr int kChoiceRadius = 7;  // of the patches that tell whether the fit helps

// The images that X, X^A and X^B are pulled towards.
struct Targets {
  Rgb<float> mean, half[2], crossed[2];
};

class JamesStein : public Method {
 public:
  const char* name() const override { return "js"; }
  const char* description() const override {
    return "James-Stein shrinkage of the unbiased image, in blocks, towards a fit of the biased one";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = true;
    needs.features = needs.featureNoise = true;
    needs.passes = 4;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override {
    if (of.denoiseHalf) return {244, 52, 0, 12};
    return {208, 52};
  }
  std::vector<OptionInfo> options() const override {
    return {kConstant,     kRegression, kVariance, kSigma,    kCrossed,  kGlobal,
            kPositivePart, kStride,     kGate,     kMeasured, kOwnHalves};
  }
  MethodResult run(const MethodInputs& in) const override;
};

JamesSteinSettings settingsOf(const MethodOptions& o) {
  JamesSteinSettings s;
  s.constant = std::max(0.0, o.number(kConstant));
  constexpr VarianceFilter kFilters[] = {VarianceFilter::Box, VarianceFilter::Gaussian, VarianceFilter::Robust,
                                         VarianceFilter::Whitened};
  s.filter = kFilters[static_cast<int>(std::clamp(o.number(kVariance), 0.0, 3.0))];
  s.sigma = o.number(kSigma);
  s.global = o.number(kGlobal) != 0;
  s.positivePart = o.number(kPositivePart) != 0;
  s.gate = o.number(kGate) != 0;
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
}

// The biased image with halves that carry nothing of each other's noise.
Estimate withOwnHalves(const MethodInputs& in) {
  Estimate y;
  for (int h = 0; h < 2; ++h) y.half[h] = in.denoiseHalf(h);
  y.mean = in.biased->mean;
  return y;
}

Targets targetsOf(const MethodInputs& in, const Estimate& y, const Rgb<float>& variance, MethodResult& result) {
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
  for (int h = 0; h < 2; ++h) {
    t.half[h] = std::move(fit.own[h]);
    t.crossed[h] = std::move(fit.crossed[h]);
  }
  if (in.options.number(kRegression) == 2) chooseBetween(x, y, variance, in.features, t);
  result.remarks.push_back(fit.report.attribute("js-regression"));
  return t;
}

Attribute number(const std::string& name, double value) {
  Attribute a;
  a.name = name;
  a.kind = Attribute::Kind::Float;
  a.number = value;
  return a;
}

MethodResult JamesStein::run(const MethodInputs& in) const {
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
  const JamesSteinSettings settings = settingsOf(in.options);
  const bool halves = hasHalves(x) && hasHalves(y), crossed = halves && in.options.number(kCrossed) != 0;
  const Rgb<float> variance = meanVariance(x);
  const Targets targets = targetsOf(in, y, variance, result);
  const NoiseScale scale = noiseScale(variance, settings);
  LeastFactors least;
  const bool measured = halves && settings.positivePart && !settings.global && in.options.number(kMeasured) != 0;
  if (measured) {
    least.blocks = crossHalfShrinkage(x, targets.half, scale.gate, settings.radius);
    if (settings.gate) least.fireflies = crossHalfFireflyShrinkage(x, targets.half, scale.gate, settings.radius);
  }
  const auto shrink = [&](const Rgb<float>& image, const Rgb<float>& noise, const NoiseScale& units,
                          const Rgb<float>& target) {
    return jamesStein(image, noise, units, target, settings, measured ? &least : nullptr);
  };
  ShrunkImage shrunk[2];
  for (int h = 0; halves && h < 2; ++h) {
    const Rgb<float> noise = halfVariance(x, variance, h);
    shrunk[h] =
        shrink(x.half[h], noise, noiseScale(noise, settings), crossed ? targets.crossed[1 - h] : targets.half[h]);
    out.half[h] = shrunk[h].image;
  }
  ShrunkImage full = crossed
                         ? ShrunkImage{average(out.half[0], out.half[1]), average(shrunk[0].factor, shrunk[1].factor)}
                         : shrink(x.mean, variance, scale, targets.mean);
  out.mean = std::move(full.image);
  if (halves && !crossed) result.error = errorMap(out.half, x, variance, out.mean);
  const char* const channels[3] = {"R", "G", "B"};
  for (size_t c = 0; c < 3; ++c)
    result.aovs.push_back({std::string("shrinkage.js.") + channels[c], std::move(full.factor[c])});
  result.remarks.push_back(number(kConstant.name, settings.constant));
  return result;
}

}  // namespace

std::unique_ptr<Method> make_js() { return std::make_unique<JamesStein>(); }

}  // namespace braid
