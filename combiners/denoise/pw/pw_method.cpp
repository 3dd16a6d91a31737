// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw/pw_method.h"

#include <algorithm>
#include <array>
#include <utility>

#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

class PatchWelch : public Method {
 public:
  PatchWelch(std::string name, std::string description, double threshold)
      : name_(std::move(name)), description_(std::move(description)), threshold_(thresholdOption(name_, threshold)) {}

  const char* name() const override { return name_.c_str(); }
  const char* description() const override { return description_.c_str(); }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override { return patchWelchNeeds(); }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {48, 36, 2'300'000}; }
  std::vector<OptionInfo> options() const override { return {threshold_}; }

  MethodResult run(const MethodInputs& in) const override {
    const PatchWelchInput input = patchWelchInputOf(in, name_);
    const std::array<double, 1> thresholds = {thresholdOf(in, threshold_)};
    MethodResult result = patchWelchResult(std::move(patchWelch(input, thresholds, {}, {}, in.cancel)[0]));
    result.remarks.push_back(numberAttribute(threshold_.name, thresholds[0]));
    return result;
  }

 private:
  std::string name_, description_;
  OptionInfo threshold_;
};

}  // namespace

Needs patchWelchNeeds() {
  Needs needs;
  needs.passes = 2;
  needs.helpful.features = true;
  needs.halves = needs.variance = false;
  return needs;
}

PatchWelchInput patchWelchInputOf(const MethodInputs& in, const std::string& method) {
  PatchWelchInput input = patchWelchInput(*in.unbiased, in.features);
  if (input.variance.empty())
    throw Error(ExitCode::BadInput, method + " needs the variance of its input, or the halves of at least two passes");
  if (in.meanOnly) input.images.resize(1);
  return input;
}

OptionInfo thresholdOption(const std::string& method, double fallback) {
  return {method + "-threshold",
          fallback,
          "Normal deviates up to which a difference of means counts as noise",
          0.1,
          10,
          false};
}

double thresholdOf(const MethodInputs& in, const OptionInfo& option) {
  return std::clamp(in.options.number(option), option.least, option.most);
}

MethodResult patchWelchResult(std::vector<Rgb<float>> images) {
  MethodResult result;
  result.image.mean = std::move(images[0]);
  for (size_t h = 0; h + 1 < images.size(); ++h) result.image.half[h] = std::move(images[1 + h]);
  return result;
}

std::unique_ptr<Method> patchWelchMethod(const std::string& name, const std::string& description, double threshold) {
  return std::make_unique<PatchWelch>(name, description, threshold);
}

}  // namespace braid
