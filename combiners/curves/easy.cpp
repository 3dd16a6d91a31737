// SPDX-License-Identifier: Apache-2.0
// Easy blending, a baseline of the curves: every pixel and channel is the noisy value where the denoised one has the
// larger estimated squared error, and the denoised value elsewhere. The error of the denoised image is Stein's unbiased
// risk estimate, for which the denoiser runs twice more; both maps pass through the same filter.
#include "combiners/curves/sure_blend.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

const OptionInfo kStep = sureStepOption("easy");

class Easy : public Method {
 public:
  const char* name() const override { return "easy"; }
  const char* description() const override {
    return "Noisy or denoised, whichever has the smaller estimated error (SURE)";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = needs.redenoise = true;
    needs.halves = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {80, 44}; }
  std::vector<OptionInfo> options() const override { return {kStep}; }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult Easy::run(const MethodInputs& in) const {
  const Rgb<float>& variance = in.unbiased->variance;
  const Rgb<float> sure = denoisedSureMaps(in, *in.unbiased, kStep).risk;
  const double sigma = sureMapFilterSigma(variance);
  const Rgb<float> v = gaussianFiltered(variance, sigma);
  Rgb<float> error = gaussianFiltered(sure, sigma);
  applySignRule(error, sure, variance);

  SureBlend blend(in);
  parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const bool takeNoisy = error[c][i] > v[c][i];
        blend.set(c, i, [takeNoisy](float noisy, float denoised) { return takeNoisy ? noisy : denoised; });
        blend.result.error[i] += (takeNoisy ? v[c][i] : error[c][i]) / 3;
        blend.share[i] += takeNoisy ? 1.0f / 3 : 0.0f;
      }
  });
  return blend.finish(name(), sigma);
}

}  // namespace

std::unique_ptr<Method> make_easy() { return std::make_unique<Easy>(); }

}  // namespace braid
