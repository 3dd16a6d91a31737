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
#include <cmath>
#include <utility>

#include "combiners/shrinkage/debias.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/double_shrinkage_prior.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/shrinkage/shrinkage_errors.h"
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

const OptionInfo kFireflies{"double-shrinkage-remove-fireflies", 1,
                            "1: remove fireflies of a photon map that only one or two quarters show; 0: the paper"};
const OptionInfo kDebias{"double-shrinkage-debias", 1,
                         "1: correct a photon map by its own bias estimate; 0: the paper"};
const OptionInfo kMeasured{
    "double-shrinkage-measured", 1,
    "1: measure a photon map's bias, and light that the unbiased image lacks, across halves; 0: the paper"};
const OptionInfo kFused{"double-shrinkage-fused", 1,
                        "1: fit the prior to the photon map where that is far better, and measure it so; 0: the paper"};
const OptionInfo kChosen{"double-shrinkage-chosen", 1,
                         "1: take the prior where halves show it to be of use; 0: everywhere (paper)"};

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
  Needs needs() const override { return doubleShrinkageNeeds(); }
  MethodMemory memory(const MemoryCase& of) const override { return doubleShrinkageMemory(of); }
  std::vector<OptionInfo> options() const override {
    return {kPrior, kStage, kStride, kOwnHalves, kGate, kDebias, kFireflies, kMeasured, kFused, kChosen};
  }
  MethodResult run(const MethodInputs& in) const override { return runDoubleShrinkage(in, nullptr); }
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
  Plane<float> error = crossHalfErrorMap(out.half, first, first.variance, out.mean);
  for (size_t i = 0; i < error.size(); ++i) squaredBias[i] *= toBiased[i] * toBiased[i];
  const Plane<float> bias = smoothedSquaredBias(squaredBias, out.mean);
  for (size_t i = 0; i < error.size(); ++i)
    error[i] = finiteFloat(static_cast<double>(error[i]) + static_cast<double>(bias[i]));
  return error;
}

// One run: what its steps leave to each other.
class DoubleShrinkageRun {
 public:
  DoubleShrinkageRun(const MethodInputs& given, const ErrorModel* model)
      : given_(given), model_(model), in_(given), variance_(meanVariance(*given.unbiased)) {}
  MethodResult run();

 private:
  void cleanInputs();
  void measureErrors();
  // The second shrinkage, of the image of the first.
  void shrinkTowardsPrior(Maps& maps);
  Estimate priorOf(const PriorInput& of, const Estimate& first);
  // What the model says of all errors; the maps and the first shrinkage follow from that.
  void learn(const Rgb<float>& prior, Plane<float>& errorP, Maps& maps, Estimate& first);
  void addPlane(const std::string& name, Plane<float> plane) {
    result_.aovs.push_back({name + (model_ ? ".double-shrinkage-neural" : ".double-shrinkage"), std::move(plane)});
  }

  bool isOn(const OptionInfo& option) const { return in_.options.number(option) != 0; }
  const Estimate& x() const { return *in_.unbiased; }
  const Estimate& y() const { return *in_.biased; }
  bool halves() const { return hasHalves(x()) && hasHalves(y()); }
  // Without halves nothing shows how good a prior is.
  bool hasPrior() const {
    return halves() && (model_ || (in_.options.number(kStage) >= 2 && in_.options.number(kPrior) < 2));
  }

  const MethodInputs& given_;
  const ErrorModel* model_;
  MethodInputs in_;      // what is combined
  Rgb<float> variance_;  // of x
  Estimate clean_, cleanMap_;
  Plane<float> errorU_, errorB_, squaredBias_;  // the last one of a photon map only
  ShrinkageErrors samples_;                     // with a model: as pixels say them
  MethodResult result_;
};

void DoubleShrinkageRun::cleanInputs() {
  if (!given_.biased->bias.empty()) {
    cleanMap_ = prepared(given_);
    in_.biased = &cleanMap_;
  }
  if (!isOn(kGate) || !halves()) return;
  clean_ = withoutLoneFireflies(x(), y(), variance_);
  in_.unbiased = &clean_;
}

void DoubleShrinkageRun::measureErrors() {
  const bool measured = isOn(kMeasured);
  errorU_ = unbiasedError(x(), variance_);
  errorB_ = biasedError(y(), x(), variance_, in_.features, measured);
  if (model_ && hasPrior()) samples_ = {channelMean(variance_), biasedErrorSamples(y(), x(), variance_), {}};
  if (y().bias.empty()) return;
  if (measured) countMissingLight(errorU_, x(), variance_, y(), errorB_);
  if (measured && !samples_.unbiased.empty()) countMissingLight(samples_.unbiased, x(), variance_, y(), errorB_);
  squaredBias_ = squaredBiasSamples(y());
  cleanMap_.bias = cleanMap_.biasVariance = Rgb<float>();  // read no more
}

Estimate DoubleShrinkageRun::priorOf(const PriorInput& of, const Estimate& first) {
  PriorChoice choice;
  choice.optimisedBias = !model_ && in_.options.number(kPrior) == 1;
  choice.ownHalves = isOn(kOwnHalves);
  choice.stride = static_cast<int>(std::clamp(in_.options.number(kStride), 1.0, 64.0));
  RegressionReport report;
  Estimate prior = doubleShrinkagePrior(in_, of, first, choice, report);
  result_.remarks.push_back(report.attribute("double-shrinkage-regression"));
  return prior;
}

void DoubleShrinkageRun::learn(const Rgb<float>& prior, Plane<float>& errorP, Maps& maps, Estimate& first) {
  ShrinkageErrors filtered{std::move(errorU_), std::move(errorB_), std::move(errorP)};
  ShrinkageErrors said = (*model_)({x().mean, y().mean, prior, samples_, filtered});
  samples_ = {};
  errorU_ = std::move(said.unbiased);
  errorB_ = std::move(said.biased);
  errorP = std::move(said.prior);
  maps = Maps(errorU_, errorB_, errorP);
  first = meanOf(x(), variance_, y(), maps.toBiased);
}

void DoubleShrinkageRun::shrinkTowardsPrior(Maps& maps) {
  Estimate& out = result_.image;
  Estimate first = std::move(out);
  PriorInput of = {&x(), &variance_, errorU_};
  Estimate trusted;
  if (isOn(kFused) && !squaredBias_.empty()) {
    const Plane<float> share = fourthPower(maps.toBiased);
    trusted = meanOf(x(), variance_, y(), share);
    of = {&trusted, &trusted.variance, errorOfMean(errorU_, errorB_, share)};
  }
  Estimate prior = priorOf(of, first);
  Plane<float> errorP = priorError(prior.mean, prior.half, *of.x, *of.variance, of.error);
  if (model_)
    learn(prior.mean, errorP, maps, first);
  else
    maps = Maps(errorU_, errorB_, errorP);
  out = towards(prior, first, maps.toPrior);
  if (isOn(kChosen)) chooseBetween(out, first, in_.features);
  if (!squaredBias_.empty()) result_.error = estimatedError(out, first, maps.toBiased, squaredBias_);
  const char* const channels[3] = {".R", ".G", ".B"};
  for (size_t c = 0; c < 3; ++c) {
    addPlane("prior", std::move(prior.mean[c]));
    result_.aovs.back().name += channels[c];
  }
  addPlane("eta2", std::move(errorP));
}

MethodResult DoubleShrinkageRun::run() {
  cleanInputs();
  measureErrors();
  Maps maps(errorU_, errorB_, {});
  Estimate& out = result_.image;
  out = meanOf(x(), variance_, y(), maps.toBiased);
  out.unbiased = false;
  if (hasPrior()) shrinkTowardsPrior(maps);
  out.variance = Rgb<float>();  // it is not that of the prior's part
  addPlane("kappa1", std::move(maps.toBiased));
  addPlane("kappa2", std::move(maps.toPrior));
  addPlane("error-unbiased", std::move(errorU_));
  addPlane("error-biased", std::move(errorB_));
  if (result_.error.empty())
    result_.error = halves() ? crossHalfErrorMap(out.half, *given_.unbiased, meanVariance(*given_.unbiased), out.mean)
                             : std::move(maps.variance);
  return std::move(result_);
}

}  // namespace

MethodResult runDoubleShrinkage(const MethodInputs& in, const ErrorModel* model) {
  return DoubleShrinkageRun(in, model).run();
}

Needs doubleShrinkageNeeds() {
  Needs needs;
  needs.biased = true;
  needs.helpful.features = needs.helpful.featureNoise = true;
  needs.helpful.quarters = true;
  needs.passes = 4;
  return needs;
}

MethodMemory doubleShrinkageMemory(const MemoryCase& of) { return {284 + (of.photonMap ? 108 : 0), 72}; }

std::vector<OptionInfo> commonDoubleShrinkageOptions() {
  return {kStride, kOwnHalves, kGate, kDebias, kFireflies, kMeasured, kFused, kChosen};
}

DoubleShrinkage doubleShrinkage(double unbiasedError, double biasedError, double priorError) {
  DoubleShrinkage s;
  const double sum = unbiasedError + biasedError;
  s.toBiased = std::isinf(unbiasedError) ? 1.0 : sum > 0 ? unbiasedError / sum : 0.0;
  const double h = std::isinf(unbiasedError) ? biasedError : s.toBiased * biasedError;
  const double harmonic = std::isinf(biasedError) ? unbiasedError : h;
  s.toPrior = std::isinf(priorError) ? 0.0 : harmonic + priorError > 0 ? harmonic / (harmonic + priorError) : 0.0;
  s.variance = std::isinf(priorError) ? harmonic : s.toPrior * priorError;
  return s;
}

std::unique_ptr<Method> make_double_shrinkage() { return std::make_unique<DoubleShrinkageMethod>(); }

}  // namespace braid
