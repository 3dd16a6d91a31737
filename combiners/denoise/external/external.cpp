// SPDX-License-Identifier: Apache-2.0
// The result of any other denoiser, from files: external:FILE or external:FILE:HALFA:HALFB, where the halves are that
// denoiser's images of the two halves of the samples. A FILE that holds them itself has the layers halfA and halfB.
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "combiners/pipeline/exposure.h"
#include "combiners/pipeline/invalid_pixels.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

class External : public ExternalMethod {
 public:
  External() = default;
  explicit External(std::vector<std::string> files) : files_(std::move(files)) {}

  const char* name() const override { return "external"; }
  const char* description() const override {
    return "Another denoiser's image: external:FILE[:HALFA:HALFB], any format that is read";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.halves = needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override {
    return {static_cast<int>(files_.size()) * 24, static_cast<int>(files_.size()) * 12};
  }
  std::string skipReason() const override;
  std::unique_ptr<Method> with(const std::string& parameter) const override;
  MethodResult run(const MethodInputs& in) const override;

 private:
  std::vector<std::string> files_;  // image, or image and two halves
};

std::string External::skipReason() const {
  if (files_.empty()) return "needs a file: external:FILE, or external:FILE:HALFA:HALFB with images of the halves";
  std::error_code ignored;
  for (const std::string& file : files_)
    if (!std::filesystem::is_regular_file(file, ignored)) return fmt::format("{}: no such file", file);
  return {};
}

std::unique_ptr<Method> External::with(const std::string& parameter) const {
  std::vector<std::string> files(1);
  for (const char c : parameter)
    if (c == ':')
      files.emplace_back();
    else
      files.back() += c;
  bool complete = files.size() == 1 || files.size() == 3;
  for (const std::string& file : files) complete = complete && !file.empty();
  if (!complete)
    throw Error(ExitCode::Usage,
                fmt::format("external:{}: expected external:FILE or external:FILE:HALFA:HALFB", parameter));
  return std::make_unique<External>(std::move(files));
}

Rgb<float> checked(const ImageFile& file, const std::string& layer, const Rgb<float>& like) {
  if (file.width != like.width() || file.height != like.height())
    throw Error(ExitCode::BadInput, fmt::format("{}: {}x{} pixels, but the image that it should go with has {}x{}",
                                                file.path, file.width, file.height, like.width(), like.height()));
  return file.rgb(layer);
}

MethodResult External::run(const MethodInputs& in) const {
  MethodResult result;
  Estimate& e = result.image;
  const Rgb<float>& like = in.unbiased->mean;
  const ImageFile file = readImage(files_.at(0));
  e.mean = checked(file, "", like);
  if (files_.size() == 3) {
    for (size_t h = 0; h < 2; ++h) e.half[h] = checked(readImage(files_[1 + h]), "", like);
  } else if (hasLayer(file, "halfA") && hasLayer(file, "halfB")) {
    e.half[0] = checked(file, "halfA", like);
    e.half[1] = checked(file, "halfB", like);
  }
  const auto filled = static_cast<int64_t>(fillInvalid(e));
  SanitiseReport report;
  // Files hold the units of the render; what methods see is exposure-normalised.
  e = normalised(e, in.options.number(kPipelineExposure), report);
  if (filled > 0) result.remarks.push_back(wholeAttribute("filledPixels", filled));
  return result;
}

}  // namespace

std::unique_ptr<Method> make_external() { return std::make_unique<External>(); }

}  // namespace braid
