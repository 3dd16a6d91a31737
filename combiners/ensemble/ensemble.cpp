// SPDX-License-Identifier: Apache-2.0
// Ensemble denoising: the mean of several denoised images with the weights that minimise its squared error, estimated
// from two halves of the samples ("Ensemble Denoising for Monte Carlo Renderings"). It is consistent as soon as one of
// the bases is. Weights are solved per pixel and channel and then smoothed (combiners/ensemble/ensemble_weights.h and
// combiners/ensemble/weight_bilateral.h); the halves of the result are the halves of the bases with the same weights.
#include <algorithm>

#include "combiners/statistics/half_statistics.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/registry.h"
#include "renderer/film/make_attribute.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/ensemble/scale_weights.h"
#include "combiners/ensemble/weight_bilateral.h"

namespace braid {

namespace {

const OptionInfo kPatch{"ensemble-patch", 7, "Width in pixels of the patches that errors are summed over; 1: the paper",
                        1, 101};
const OptionInfo kFilter{"ensemble-filter", 1, "1: smooth the weights by a cross bilateral filter; 0: do not"};
const OptionInfo kShared{"ensemble-shared", 0, "1: the same weights for all channels; 0: weights per channel"};
const OptionInfo kNonNegative{"ensemble-non-negative", 1, "0: weights may be negative, which makes fireflies"};
const OptionInfo kFullError{"ensemble-full-error", 0, "1: errors of the whole images in place of those of the halves"};

const OptionInfo kRelative{
    "ensemble-relative", 1,
    "1: errors relative to the brightness of the unbiased image, as relL2 counts them; 0: the paper's"};

const OptionInfo kPrior{"ensemble-prior",
                        6,
                        "Pull of noise towards equal weights: 6 for weights that may be anything; 0: the paper's",
                        0,
                        1e6,
                        false};

const OptionInfo kScales{
    "ensemble-scales", 0,
    "1: weights from errors of the whole image and of windows of two sizes, as auto's; 0: the paper's"};

constexpr double kImprovement = 1e-4;  // combiners/EXPERIMENTS.md, Precision of ensemble weights

// Fewer passes leave too few in each half to distinguish the bases.
constexpr uint64_t kFewestPasses = 8;

class Ensemble : public Method {
 public:
  const char* name() const override { return "ensemble"; }
  const char* description() const override { return "Mean of several denoised images with optimised weights"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.bases = 2;
    needs.helpful.features = true;
    needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override {
    const bool quarters = of.passes == 0 || of.passes >= 4;
    return {quarters ? 50 + 23 * of.bases : 72 + 4 * of.bases, 40 + 4 * of.bases};
  }
  std::vector<OptionInfo> options() const override {
    return {kPatch, kFilter, kShared, kNonNegative, kFullError, kRelative, kPrior, kScales};
  }
  MethodResult run(const MethodInputs& in) const override;
};

EnsembleChoices choicesOf(const MethodOptions& options) {
  EnsembleChoices choices;
  choices.improvement = kImprovement;
  choices.patchRadius = static_cast<int>(std::clamp(options.number(kPatch), 1.0, 101.0)) / 2;
  choices.shared = options.number(kShared) != 0;
  choices.nonNegative = options.number(kNonNegative) != 0;
  choices.fullError = options.number(kFullError) != 0;
  choices.prior = std::max(0.0, options.number(kPrior));
  return choices;
}

// The weights of the paper, by the options.
WeightMaps patchWeights(const MethodInputs& in) {
  EnsembleChoices choices = choicesOf(in.options);
  Plane<float> roots;
  if (in.options.number(kRelative) != 0) {
    roots = relativeErrorRoots(in.unbiased->mean, meanVariance(*in.unbiased));
    choices.rootWeights = &roots;
  }
  const WeightMaps weights = ensembleWeights(*in.unbiased, in.bases, choices);
  if (in.options.number(kFilter) == 0) return weights;
  return filteredWeights(weights, weightedEstimate(weights, in.bases), in.features);
}

MethodResult Ensemble::run(const MethodInputs& in) const {
  MethodResult result;
  const uint64_t passes = in.unbiased->passes;
  const bool scales = in.options.number(kScales) != 0;
  WeightMaps weights;
  if (!scales && passes > 0 && passes < kFewestPasses) {
    weights = uniformWeights(in.bases.size(), 1, in.unbiased->mean.width(), in.unbiased->mean.height());
    result.remarks.push_back(textAttribute("weights", "equal, for there are fewer than 8 passes"));
  } else {
    weights = scales ? scaleWeights(*in.unbiased, in.bases, in.features) : patchWeights(in);
  }
  result.image = weightedEstimate(weights, in.bases);
  result.error = crossHalfErrorMap(result.image.half, *in.unbiased, meanVariance(*in.unbiased), result.image.mean);
  std::vector<Plane<float>> maps = channelMeans(weights);
  for (size_t b = 0; b < in.bases.size(); ++b) {
    const std::string& base = in.bases[b]->name;
    result.aovs.push_back(
        {"weight.ensemble." + (base.empty() ? std::to_string(b) : layerName(base)), std::move(maps[b])});
    if (in.bases[b]->unbiased)
      result.remarks.push_back(textAttribute("warning", "the unbiased image as a base makes the ensemble much worse"));
  }
  return result;
}

}  // namespace

std::unique_ptr<Method> make_ensemble() { return std::make_unique<Ensemble>(); }

}  // namespace braid
