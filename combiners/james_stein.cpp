// SPDX-License-Identifier: Apache-2.0
// "js": the James-Stein combiner (Gu et al. 2022; ALGORITHMS 1) without its network: variances are box averages and
// alpha is 1/2. The unbiased image is pulled, block by block, towards a biased image that was first fitted to it by a
// crossed half-buffer regression.
//
// The paper counts on its never being worse than the unbiased image, which holds where the noise of a block is even.
// Beside lamps, highlights and outliers it is not. So lone outliers are replaced first (js-gate): over 14 scenes at 8
// to 256 samples, towards pw, 5 of 56 cases are worse than the unbiased image instead of 11, the worst by 1.3x instead
// of 8.9x, and the mean gain is 5.6x instead of 4.1x. A constant of 1.25 is a little worse in all of these than the
// paper's
// 1. The variance of each pixel (js-variance 3) loses least, 3 cases and 1.17x without the gate, but gains only 1.6x.
//
// Halves of the result. With js-regression the half h is JS(X^h, its variance, own fit of half h): the halves share the
// bandwidth kappa and the variance of all samples, but no pixel values, so that errors can be measured across them.
// Their mean is not the result, whose Y* is crossed and whose factors come from all samples. Without js-regression half
// h is JS(X^h, its variance, Y^h). With js-crossed the result is the mean of its halves JS(X^A, Ŷ^B) and JS(X^B, Ŷ^A),
// which depend on each other: there is no error map then.
#include <utility>

#include "combiners/error_map.h"
#include "combiners/optimised_bias.h"
#include "combiners/registry.h"
#include "combiners/shrinkage.h"

namespace braid {

namespace {

const OptionInfo kConstant{"js-constant", 1,
                           "Shrinkage relative to the papers' p - 2; below 2, it beats the unbiased image"};
const OptionInfo kRegression{"js-regression", 1,
                             "1: fit the biased image to the unbiased one first, 0: use it as it is"};
const OptionInfo kVariance{"js-variance", 0, "Variance of a block: 0 box, 1 Gaussian, 2 robust, 3 whitened"};
const OptionInfo kSigma{"js-sigma", 3, "Standard deviation of the Gaussian filter of the variance in pixels"};
const OptionInfo kCrossed{"js-crossed", 0, "1: combine each half with the fit of the other one, then average"};
const OptionInfo kGlobal{"js-global", 0, "1: one factor for the whole image"};
const OptionInfo kPositivePart{"js-positive-part", 1, "0: let factors be negative"};
const OptionInfo kStride{"js-stride", 4, "Distance of the regression models in pixels"};
const OptionInfo kGate{"js-gate", 1, "1: replace lone outliers of the unbiased image first"};

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
    needs.features = true;
    needs.passes = 4;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {220, 52}; }
  std::vector<OptionInfo> options() const override {
    return {kConstant, kRegression, kVariance, kSigma, kCrossed, kGlobal, kPositivePart, kStride, kGate};
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

Targets targetsOf(const MethodInputs& in, MethodResult& result) {
  const Estimate &x = *in.unbiased, &y = *in.biased;
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
  const Estimate &x = *in.unbiased, &y = *in.biased;
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
  const Targets targets = targetsOf(in, result);
  ShrunkImage shrunk[2];
  for (int h = 0; halves && h < 2; ++h) {
    shrunk[h] = jamesStein(x.half[h], halfVariance(x, variance, h), crossed ? targets.crossed[1 - h] : targets.half[h],
                           settings);
    out.half[h] = shrunk[h].image;
  }
  ShrunkImage full = crossed
                         ? ShrunkImage{average(out.half[0], out.half[1]), average(shrunk[0].factor, shrunk[1].factor)}
                         : jamesStein(x.mean, variance, targets.mean, settings);
  out.mean = std::move(full.image);
  if (halves && !crossed) result.error = errorMap(out.half, x, variance, y.mean);
  const char* const channels[3] = {"R", "G", "B"};
  for (size_t c = 0; c < 3; ++c)
    result.aovs.push_back({std::string("shrinkage.js.") + channels[c], std::move(full.factor[c])});
  result.remarks.push_back(number(kConstant.name, settings.constant));
  return result;
}

}  // namespace

std::unique_ptr<Method> make_js() { return std::make_unique<JamesStein>(); }

}  // namespace braid
