// SPDX-License-Identifier: Apache-2.0
// One base a pixel, by estimated errors that a cross bilateral filter over the features has smoothed
// (combiners/ensemble/one_hot/one_hot.h).
#include "combiners/statistics/variance.h"
#include "combiners/ensemble/one_hot/one_hot.h"
#include "combiners/pipeline/registry.h"

namespace braid {

namespace {

class OneHotSbf : public Method {
 public:
  const char* name() const override { return "one-hot-sbf"; }
  const char* description() const override { return "One base a pixel, by errors smoothed along the features"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs = oneHotNeeds();
    needs.helpful.features = needs.helpful.featureNoise = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override { return {68 + 8 * of.bases, 40 + 4 * of.bases}; }

  MethodResult run(const MethodInputs& in) const override {
    const auto errors = featureFiltered(baseErrors(*in.unbiased, in.bases), in.features, passesOf(*in.unbiased));
    return oneHotResult(in, selectionMaps(errors), name());
  }
};

}  // namespace

std::unique_ptr<Method> make_one_hot_sbf() { return std::make_unique<OneHotSbf>(); }

}  // namespace braid
