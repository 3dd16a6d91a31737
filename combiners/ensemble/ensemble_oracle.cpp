// SPDX-License-Identifier: Apache-2.0
// The ensemble with the weights that are best in hindsight: by the errors that its bases have against a reference. It
// shows how much of an ensemble's error comes from its bases, and how much from estimating their errors ("Ensemble
// Denoising for Monte Carlo Renderings", 5.2.7, of one rendering in place of many).
#include <algorithm>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/ensemble/weight_bilateral.h"

namespace braid {

namespace {

const OptionInfo kHalves{"ensemble-oracle-halves", 0,
                         "1: by the errors of the halves (M^half of the paper); 0: by those of the whole images"};
const OptionInfo kPatch{"ensemble-oracle-patch", 7, "Width in pixels of the patches that errors are summed over", 1,
                        101};
const OptionInfo kNonNegative{"ensemble-oracle-non-negative", 1, "0: weights may be negative"};
const OptionInfo kFilter{"ensemble-oracle-filter", 1, "1: smooth the weights as the ensemble does; 0: do not"};

class EnsembleOracle : public Method {
 public:
  const char* name() const override { return "ensemble-oracle"; }
  const char* description() const override {
    return "Ensemble by the true errors of its bases, from a reference: what ensemble could at best be";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.bases = 2;
    needs.helpful.features = needs.reference = true;
    needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override { return {88 + 24 * of.bases, 36 + 4 * of.bases}; }
  std::vector<OptionInfo> options() const override { return {kHalves, kPatch, kNonNegative, kFilter}; }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult EnsembleOracle::run(const MethodInputs& in) const {
  // The estimate whose noise the errors are freed of has none: with fullError, e^A and e^B make ¼ (e^A + e^B)².
  Estimate truth;
  truth.mean = truth.half[0] = truth.half[1] = *in.reference;
  const Rgb<float> noVariance(truth.mean.width(), truth.mean.height());
  const Plane<float> roots = relativeErrorRoots(truth.mean, noVariance);
  EnsembleChoices choices;
  choices.patchRadius = static_cast<int>(std::clamp(in.options.number(kPatch), 1.0, 101.0)) / 2;
  choices.nonNegative = in.options.number(kNonNegative) != 0;
  choices.fullError = in.options.number(kHalves) == 0;
  choices.rootWeights = &roots;
  WeightMaps weights = ensembleWeights(truth, in.bases, choices);
  if (in.options.number(kFilter) != 0)
    weights = filteredWeights(weights, weightedEstimate(weights, in.bases), in.features);
  MethodResult result;
  result.image = weightedEstimate(weights, in.bases);
  std::vector<Plane<float>> maps = channelMeans(weights);
  for (size_t b = 0; b < in.bases.size(); ++b) {
    const std::string& base = in.bases[b]->name;
    result.aovs.push_back(
        {"weight.ensemble-oracle." + (base.empty() ? std::to_string(b) : layerName(base)), std::move(maps[b])});
  }
  return result;
}

}  // namespace

std::unique_ptr<Method> make_ensemble_oracle() { return std::make_unique<EnsembleOracle>(); }

}  // namespace braid
