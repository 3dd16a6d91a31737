// SPDX-License-Identifier: Apache-2.0
// Non-local means guided by the image itself (nlm_filter.h), with one weight for all channels: no colour fringes. The
// baseline of the denoisers that know more. Each half is filtered with its own weights; shared weights would make the
// filter look better than it is wherever halves are compared.
#include <algorithm>
#include <cmath>

#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/statistics/variance.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

const OptionInfo kSensitivity{"nlm-k", 0.45, "Sensitivity: larger filters more", 0.01, 100, false};
const OptionInfo kWindow{"nlm-window", 10, "Radius of the window in pixels", 0, 100};
const OptionInfo kPatch{"nlm-patch", 3, "Radius of the patches in pixels", 0, 20};

Rgb<float> finiteCopy(const Rgb<float>& in) {
  Rgb<float> out = in;
  for (size_t c = 0; c < 3; ++c)
    for (float& v : out[c].data) v = std::isfinite(v) ? v : 0.0f;
  return out;
}

class NonLocalMeans : public Method {
 public:
  const char* name() const override { return "nlm"; }
  const char* description() const override { return "Non-local means with variance-aware distances, without features"; }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 2;
    needs.halves = needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {60, 36, 900'000}; }
  std::vector<OptionInfo> options() const override { return {kSensitivity, kWindow, kPatch}; }

  MethodResult run(const MethodInputs& in) const override {
    const Estimate& e = *in.unbiased;
    const Rgb<float> variance = regularisedVariance(e);
    if (variance.empty())
      throw Error(ExitCode::BadInput, "nlm needs the variance of its input, or the halves of at least two passes");
    const int window = static_cast<int>(std::clamp(in.options.number(kWindow), 0.0, 100.0));
    const auto filtered = [&](const Rgb<float>& image, float varianceScale) {
      const Rgb<float> guideImage = finiteCopy(image);
      NlmGuide guide =
          nlmGuide(guideImage, variance, static_cast<float>(std::clamp(in.options.number(kSensitivity), 0.01, 100.0)),
                   static_cast<int>(std::clamp(in.options.number(kPatch), 0.0, 20.0)));
      guide.varianceScale = varianceScale;
      return nlmFilter(guide, window, guideImage);
    };
    MethodResult result;
    result.image.mean = filtered(e.mean, 1);
    if (!in.meanOnly && !e.half[0].empty() && !e.half[1].empty())
      for (int h = 0; h < 2; ++h) result.image.half[h] = filtered(e.half[h], 2);
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_nlm() { return std::make_unique<NonLocalMeans>(); }

}  // namespace braid
