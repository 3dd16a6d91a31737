// SPDX-License-Identifier: Apache-2.0
// Cross-weighting, a baseline of input-dependent uncorrelated weighting: the weights of each half of the samples come
// from the other half, so they are independent of what they weight and the image has no bias; but they cannot avoid the
// noise that is in it. The result is the mean of both halves.
#include "combiners/pipeline/registry.h"
#include "combiners/uncorrelated/uncorrelated_groups.h"

namespace braid {

namespace {

const OptionInfo kGamma = gammaOption("uncorrelated-cross");

class UncorrelatedCross : public Method {
 public:
  const char* name() const override { return "uncorrelated-cross"; }
  const char* description() const override {
    return "Independent and correlated image, each half weighted by the other: an unbiased baseline";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return uncorrelatedNeeds(); }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {50, 40}; }
  std::vector<OptionInfo> options() const override { return {kGamma}; }

  MethodResult run(const MethodInputs& in) const override {
    const Estimate &y = *in.unbiased, &z = *in.correlated;
    const UncorrelatedInputs groups[2] = {uncorrelatedGroup(y, z, 0, 0, 1), uncorrelatedGroup(y, z, 1, 1, 0)};
    MethodResult result;
    filterGroups(in, kGamma, groups, result);
    Estimate& out = result.image;
    out.mean = average(out.half[0], out.half[1]);
    result.error = halvesVariance(out.half);
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_uncorrelated_cross() { return std::make_unique<UncorrelatedCross>(); }

}  // namespace braid
