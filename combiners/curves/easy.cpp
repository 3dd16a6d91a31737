// SPDX-License-Identifier: Apache-2.0
// Easy blending, a baseline of the curves: every pixel and channel is the noisy value where the denoised one has the
// larger estimated squared error, and the denoised value elsewhere. The error of the denoised image is Stein's unbiased
// risk estimate, for which the denoiser runs twice more; both maps pass through the same filter.
#include <algorithm>

#include "combiners/pipeline/registry.h"
#include "combiners/statistics/sure_map.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

const OptionInfo kStep{"easy-step", 0.1, "Perturbation of the risk estimate in standard deviations of a pixel",
                       0.001,       10,  false};

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

// The halves take the choice of the whole image, where both inputs have halves.
MethodResult Easy::run(const MethodInputs& in) const {
  const Estimate &n = *in.unbiased, &d = *in.biased;
  if (!in.redenoise) throw Error(ExitCode::Usage, "needs a denoiser that it can run again as its biased input");
  const double step = std::clamp(in.options.number(kStep), 1e-3, 10.0);
  const Rgb<float> sure = sureMaps(n.mean, d.mean, n.variance, in.seed, step, in.redenoise).risk;
  const double sigma = sureMapFilterSigma(n.variance);
  const Rgb<float> v = gaussianFiltered(n.variance, sigma);
  Rgb<float> error = gaussianFiltered(sure, sigma);
  applySignRule(error, sure, n.variance);

  const int width = n.mean.width(), height = n.mean.height();
  MethodResult result;
  result.image.mean = Rgb<float>(width, height);
  const bool halves = !n.half[0].empty() && !n.half[1].empty() && !d.half[0].empty() && !d.half[1].empty();
  if (halves) result.image.half[0] = result.image.half[1] = Rgb<float>(width, height);
  result.error = Plane<float>(width, height);
  Plane<float> noisyShare(width, height);
  parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const bool takeNoisy = error[c][i] > v[c][i];
        const auto chosen = [&](const Rgb<float>& a, const Rgb<float>& b) { return takeNoisy ? a[c][i] : b[c][i]; };
        result.image.mean[c][i] = chosen(n.mean, d.mean);
        for (int h = 0; halves && h < 2; ++h) result.image.half[h][c][i] = chosen(n.half[h], d.half[h]);
        result.error[i] += (takeNoisy ? v[c][i] : error[c][i]) / 3;
        noisyShare[i] += takeNoisy ? 1.0f / 3 : 0.0f;
      }
  });
  result.aovs.push_back({"weight.easy", std::move(noisyShare)});
  Attribute sigmaRemark;
  sigmaRemark.name = "sureMapFilterSigma";
  sigmaRemark.kind = Attribute::Kind::Float;
  sigmaRemark.number = sigma;
  result.remarks.push_back(sigmaRemark);
  return result;
}

}  // namespace

std::unique_ptr<Method> make_easy() { return std::make_unique<Easy>(); }

}  // namespace braid
