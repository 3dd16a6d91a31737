// SPDX-License-Identifier: Apache-2.0
// Ideal blending: in every pixel and channel the mix of the noisy and the denoised image that is nearest to a reference
// ("Converging Algorithm-Agnostic Denoising for Monte Carlo Rendering", 2.1, Eq. 4, with the sign that the reference
// decides). What any choice of one weight a pixel, by curves or otherwise, could at best be.
#include <algorithm>

#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

class Ideal : public Method {
 public:
  const char* name() const override { return "ideal"; }
  const char* description() const override {
    return "Mix of noisy and denoised nearest to a reference: what curves could at best be";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = needs.reference = true;
    needs.halves = needs.variance = false;
    needs.passes = 1;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {16, 16}; }
  MethodResult run(const MethodInputs& in) const override;
};

// The share of the denoised value d that brings the noisy value n nearest to r.
float idealShare(float n, float d, float r) {
  const float whole = d - n;
  return whole == 0 ? 0 : std::clamp((r - n) / whole, 0.0f, 1.0f);
}

MethodResult Ideal::run(const MethodInputs& in) const {
  const Rgb<float>&n = in.unbiased->mean, &d = in.biased->mean, &r = *in.reference;
  MethodResult result;
  result.image.mean = Rgb<float>(n.width(), n.height());
  Plane<float> denoisedShare(n.width(), n.height());
  parallelChunks(n.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const float share = idealShare(n[c][i], d[c][i], r[c][i]);
        result.image.mean[c][i] = (1 - share) * n[c][i] + share * d[c][i];
        denoisedShare[i] += share / 3;
      }
  });
  result.aovs.push_back({"weight.ideal", std::move(denoisedShare)});
  return result;
}

}  // namespace

std::unique_ptr<Method> make_ideal() { return std::make_unique<Ideal>(); }

}  // namespace braid
