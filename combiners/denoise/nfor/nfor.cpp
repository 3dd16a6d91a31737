// SPDX-License-Identifier: Apache-2.0
// First-order regression on features, NFOR (nfor_filter.h). With --nfor-demodulate 0 --nfor-offsets 0 --nfor-stride 1
// --nfor-remove-fireflies 0 it is the method of the paper.
#include <algorithm>

#include "combiners/pixels/channel_mean.h"
#include "combiners/denoise/nfor/nfor_filter.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kDemodulate{"nfor-demodulate", 1, "1: regress colours divided by albedos; 0: colours (paper)"};
const OptionInfo kOffsets{"nfor-offsets", 1, "1: pixel offsets are features too; 0: the paper"};
const OptionInfo kVariance{"nfor-variance", 0,
                           "Variance behind the weights: 0 of the samples, 1 shrunk to a box mean, 2 filtered", 0, 2};
const OptionInfo kFireflies{"nfor-remove-fireflies", 1,
                            "1: remove fireflies that only one half or two quarters show; 0: the paper"};
const OptionInfo kStride{"nfor-stride", 2, "Distance of the regression models in pixels; 1: the paper", 1, 9};

NforOptions optionsOf(const MethodInputs& in) {
  NforOptions options;
  options.demodulate = in.options.number(kDemodulate) != 0;
  options.offsets = in.options.number(kOffsets) != 0;
  const double variance = in.options.number(kVariance);
  options.variance = variance == 1   ? NforVariance::Shrunk
                     : variance == 2 ? NforVariance::NonLocal
                                     : NforVariance::Sample;
  options.stride = static_cast<int>(std::clamp(in.options.number(kStride), 1.0, 9.0));
  options.removeFireflies = in.options.number(kFireflies) != 0;
  options.quarters = in.quarters;
  options.cancel = in.cancel;
  return options;
}

class Nfor : public Method {
 public:
  const char* name() const override { return "nfor"; }
  const char* description() const override { return "First-order regression on features, crossed between the halves"; }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 2;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.variance = false;
    needs.helpful.quarters = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {520, 44}; }
  std::vector<OptionInfo> options() const override { return {kDemodulate, kOffsets, kVariance, kStride, kFireflies}; }

  MethodResult run(const MethodInputs& in) const override {
    const Estimate& e = *in.unbiased;
    if (e.passes == 1 || e.half[0].empty() || e.half[1].empty())
      throw Error(ExitCode::BadInput, "nfor needs the halves of at least two passes");
    const NforOptions options = optionsOf(in);
    NforResult filtered = nforFilter(e, in.features, options);
    MethodResult result;
    result.image.mean = std::move(filtered.mean);
    for (int h = 0; h < 2; ++h) result.image.half[h] = std::move(filtered.half[h]);
    result.error = crossHalfErrorMap(result.image.half, e, meanVariance(e), result.image.mean);
    const Rgb<float>& share = filtered.selection;
    result.aovs.push_back({"weight.nfor.wide", channelMean(share.width(), share.height(), [&](size_t i, size_t c) {
                             return static_cast<double>(share[c][i]);
                           })});
    result.remarks = {numberAttribute(kDemodulate.name, options.demodulate),
                      numberAttribute(kOffsets.name, options.offsets),
                      numberAttribute(kVariance.name, static_cast<double>(options.variance)),
                      numberAttribute(kStride.name, options.stride),
                      numberAttribute(kFireflies.name, options.removeFireflies),
                      filtered.report.attribute("nfor-regression")};
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_nfor() { return std::make_unique<Nfor>(); }

}  // namespace braid
