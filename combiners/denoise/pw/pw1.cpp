// SPDX-License-Identifier: Apache-2.0
// The first-order patch-Welch filter (pw1_filter.h): for 64 samples and more; below that its slopes fit noise.
#include <algorithm>

#include "combiners/denoise/pw/pw1_filter.h"
#include "combiners/denoise/pw/pw_method.h"
#include "combiners/pipeline/registry.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kThreshold = thresholdOption("pw1", kPatchWelchWideThreshold);
const OptionInfo kStride{"pw1-stride", FirstOrderOptions().stride,
                         "Pixels between the centres of the fits: below 5, their weights take more memory than planned",
                         1, PatchWelchNeighbours().radius};

class PatchWelchFirstOrder : public Method {
 public:
  const char* name() const override { return "pw1"; }
  const char* description() const override {
    return "First-order regression with patch-Welch weights, from 64 samples";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override { return patchWelchNeeds(); }
  // 47 of the peak are the weights at the usual stride.
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {95, 36, 4'550'000}; }
  std::vector<OptionInfo> options() const override { return {kThreshold, kStride}; }

  MethodResult run(const MethodInputs& in) const override {
    const PatchWelchInput input = patchWelchInputOf(in, name());
    FirstOrderOptions options;
    options.threshold = thresholdOf(in, kThreshold);
    options.stride = static_cast<int>(std::clamp(in.options.number(kStride), 1.0, 1.0 * PatchWelchNeighbours().radius));
    RegressionReport report;
    MethodResult result = patchWelchResult(patchWelchFirstOrder(input, options, in.cancel, &report));
    result.remarks = {numberAttribute(kThreshold.name, options.threshold),
                      numberAttribute(kStride.name, options.stride), report.attribute("pw1-regression")};
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_pw1() { return std::make_unique<PatchWelchFirstOrder>(); }

}  // namespace braid
