// SPDX-License-Identifier: Apache-2.0
// RDFC as a denoiser (rdfc_filter.h). Its halves share weights; the error map is from them nevertheless: measured on
// synthetic cases it errs on the safe side, and less than the risk by which the candidates are chosen.
#include "combiners/denoise/rdfc/rdfc_filter.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kDemodulate{"rdfc-demodulate", 0, "1: filter the colour divided by the albedo; 0: the paper"};
const OptionInfo kVariance{"rdfc-variance", 0,
                           "Variance of the colour: 0 of the samples (paper, independent samples), 1 rescaled by the "
                           "halves (paper, low-discrepancy samples), 2 shrunk towards its neighbourhood",
                           0, 2};

const OptionInfo kFireflies{"rdfc-remove-fireflies", 1,
                            "1: remove fireflies that only one half or two quarters show; 0: the paper"};

const char* const kCandidateNames[] = {"first", "second", "third"};

RdfcOptions optionsOf(const MethodInputs& in) {
  const MethodOptions& numbers = in.options;
  RdfcOptions options;
  options.demodulate = numbers.number(kDemodulate) > 0.5;
  const double variance = numbers.number(kVariance);
  options.variance = variance > 1.5   ? RdfcVariance::Shrunk
                     : variance > 0.5 ? RdfcVariance::Rescaled
                                      : RdfcVariance::Sample;
  options.removeFireflies = numbers.number(kFireflies) != 0;
  options.quarters = in.quarters;
  return options;
}

class Rdfc : public Method {
 public:
  const char* name() const override { return "rdfc"; }
  const char* description() const override {
    return "Best of three filters on colour and features at every pixel, by estimated risk";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 2;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.halves = needs.variance = false;
    needs.helpful.quarters = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {496, 52}; }
  bool halvesShareWeights() const override { return true; }
  std::vector<OptionInfo> options() const override { return {kDemodulate, kVariance, kFireflies}; }

  MethodResult run(const MethodInputs& in) const override {
    const Estimate& e = *in.unbiased;
    const RdfcOptions options = optionsOf(in);
    if (e.passes == 1 || rdfcVariance(e, options.variance).empty())
      throw Error(ExitCode::BadInput, "rdfc needs the variance of its input, or the halves of at least two passes");
    RdfcResult filtered = rdfcDenoised(e, in.features, options, in.cancel);
    MethodResult result;
    result.image.mean = std::move(filtered.mean);
    for (size_t h = 0; h < 2; ++h) result.image.half[h] = std::move(filtered.half[h]);
    result.error = result.image.half[0].empty()
                       ? std::move(filtered.risk)
                       : crossHalfErrorMap(result.image.half, e, meanVariance(e), result.image.mean);
    for (size_t k = 0; k < filtered.selection.size(); ++k)
      result.aovs.push_back({std::string("weight.rdfc.") + kCandidateNames[k], std::move(filtered.selection[k])});
    for (const OptionInfo* option : {&kDemodulate, &kVariance, &kFireflies})
      result.remarks.push_back(numberAttribute(option->name, in.options.number(*option)));
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_rdfc() { return std::make_unique<Rdfc>(); }

}  // namespace braid
