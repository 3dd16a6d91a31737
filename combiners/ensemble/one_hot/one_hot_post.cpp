// SPDX-License-Identifier: Apache-2.0
// One base a pixel, by its estimated error as it is; then the maps of the selection pass through the filter that the
// weights of ensembles pass through. The best of the three selections in the paper
// (combiners/ensemble/one_hot/one_hot.h).
#include "combiners/ensemble/one_hot/one_hot.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/weight_bilateral.h"

namespace braid {

namespace {

class OneHotPost : public Method {
 public:
  const char* name() const override { return "one-hot-post"; }
  const char* description() const override { return "One base a pixel, by raw errors, with the selection smoothed"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs = oneHotNeeds();
    needs.helpful.features = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override { return {104 + 8 * of.bases, 40 + 4 * of.bases}; }

  MethodResult run(const MethodInputs& in) const override {
    const WeightMaps raw = selectionMaps(baseErrors(*in.unbiased, in.bases));
    return oneHotResult(in, filteredWeights(raw, weightedEstimate(raw, in.bases), in.features), name());
  }
};

}  // namespace

std::unique_ptr<Method> make_one_hot_post() { return std::make_unique<OneHotPost>(); }

}  // namespace braid
