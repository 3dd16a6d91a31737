// SPDX-License-Identifier: Apache-2.0
// One base a pixel, by estimated errors that a non-local means filter guided by the noisy image has smoothed, as NFOR
// does it: patches of 3x3 pixels, windows of 19x19 (combiners/ensemble/one_hot/one_hot.h).
#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/ensemble/one_hot/one_hot.h"
#include "combiners/pipeline/registry.h"

namespace braid {

namespace {

class OneHotNfor : public Method {
 public:
  const char* name() const override { return "one-hot-nfor"; }
  const char* description() const override { return "One base a pixel, by errors smoothed along the noisy image"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return oneHotNeeds(); }
  MethodMemory memory(const MemoryCase& of) const override { return {80 + 12 * of.bases, 40 + 4 * of.bases}; }

  MethodResult run(const MethodInputs& in) const override {
    const Rgb<float> variance = meanVariance(*in.unbiased);
    const NlmGuide guide = nlmGuide(in.unbiased->mean, variance, 1.0f, 1);
    const std::vector<Plane<float>> raw = baseErrors(*in.unbiased, in.bases);
    std::vector<Plane<float>> errors = raw;
    std::vector<const Plane<float>*> from;
    std::vector<Plane<float>*> to;
    for (size_t b = 0; b < raw.size(); ++b) {
      from.push_back(&raw[b]);
      to.push_back(&errors[b]);
    }
    nlmFilter(std::span(&guide, 1), 9, from, to);
    return oneHotResult(in, selectionMaps(errors), name());
  }
};

}  // namespace

std::unique_ptr<Method> make_one_hot_nfor() { return std::make_unique<OneHotNfor>(); }

}  // namespace braid
