// SPDX-License-Identifier: Apache-2.0
#include "tools/python/made.h"

#include "renderer/core/error.h"
#include "tools/publish/image_output.h"

namespace braid::python {

Made::Made(Estimates estimates, std::optional<Plane<float>> alpha, const CombineChoice& choice, int threads)
    : estimates_(std::move(estimates)), alpha_(std::move(alpha)) {
  combined_ = runCombining(estimates_, choice, choice.options(), threads);
  for (const std::string& name : choice.methods) {
    const PipelineOutput* out = combined_.find(name);
    if (!out || !out->ran()) {
      const std::string reason = out ? out->step.skipReason : "";
      if (choice.asked) throw Error(ExitCode::BadInput, name + " cannot run: " + reason);
      warnings_.push_back("nothing is combined: " + name + ": " + reason);
      continue;
    }
    method_ = name;
  }
  for (const PipelineOutput& out : combined_.outputs) combineSeconds_ += out.seconds;
  for (std::string& line : combineWarnings(combined_, choice.asked)) warnings_.push_back(std::move(line));
  first_ = estimates_.estimates.front().mean;  // CombinedLayers may move the estimates
  error_ = headlineError(combined_, choice.methods, estimates_);
  layers_.emplace(combined_, choice.methods, choice.weights, true, estimates_);
  image_ = layers_->headline() ? layers_->headline() : &first_;
  planes_ = namedPlanes(estimates_, *image_, alpha_ ? &*alpha_ : nullptr, exr(AovSet::All));
}

ExrOptions Made::exr(AovSet aovs) const {
  ExrOptions options;
  options.aovs = aovs;
  options.quarters = options.directIndirect = aovs == AovSet::All;
  options.layers = layers_->layers();
  return options;
}

std::string Made::save(const std::string& path, bool all) const {
  const Plane<float>* alpha = alpha_ ? &*alpha_ : nullptr;
  const Tone tone = toneOf(path, "", {}, *image_, alpha).value_or(Tone());
  return writeImageFile(path, estimates_, *image_, alpha, exr(all ? AovSet::All : AovSet::Features), tone);
}

}  // namespace braid::python
