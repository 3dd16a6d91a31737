// SPDX-License-Identifier: Apache-2.0
// Uniform weights, a baseline of input-dependent uncorrelated weighting: every pixel of the 15x15 window counts 1/225,
// so the image has no bias at all and all the noise of the differences of the correlated image.
#include "combiners/pipeline/registry.h"
#include "combiners/uncorrelated/uncorrelated_groups.h"

namespace braid {

namespace {

class UncorrelatedUniform : public Method {
 public:
  const char* name() const override { return "uncorrelated-uniform"; }
  const char* description() const override {
    return "Independent and correlated image with uniform weights: an unbiased baseline";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.correlated = true;
    needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {50, 40}; }

  MethodResult run(const MethodInputs& in) const override {
    const Estimate &y = *in.unbiased, &z = *in.correlated;
    MethodResult result;
    result.image.mean = uniformlyFiltered(y.mean, z.mean);
    for (int h = 0; h < 2; ++h) result.image.half[h] = uniformlyFiltered(y.half[h], z.half[h]);
    // Where y and z share samples, so do the halves of either: A of the result has seen A of both and nothing else.
    result.error = halvesVariance(result.image.half);
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_uncorrelated_uniform() { return std::make_unique<UncorrelatedUniform>(); }

}  // namespace braid
