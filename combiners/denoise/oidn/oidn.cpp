// SPDX-License-Identifier: Apache-2.0
// Open Image Denoise, Intel's learned denoiser: by its library where that is installed, else by its published weights
// on braid's own engine (combiners/learned).
//
// Its automatic exposure would couple all pixels and differ between the image, its halves and the perturbed images of
// SURE; the inputs are exposure-normalised by the same rule already, so its scale is fixed at 1.
#include "combiners/denoise/oidn/oidn.h"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kNetwork{"oidn-network", 1, "Without its library: 0: the small network, 1: the base, 2: the large", 0,
                          2};
const OptionInfo kPrefilter{"oidn-prefilter", 0,
                            "Without its library: 1: albedo and normals are denoised first, each by a network"};

using Denoise = std::function<Rgb<float>(const Rgb<float>& colour, const Rgb<float>* albedo, const Rgb<float>* normal)>;

// Of half h, or of all samples; null: there is none.
const Rgb<float>* featureImage(const FeaturePlanes<Rgb<float>>* feature, int h) {
  if (!feature || feature->mean.empty()) return nullptr;
  return h < 0 || feature->half[h].empty() ? &feature->mean : &feature->half[h];
}

OidnChoice choiceOf(const MethodInputs& in) {
  OidnChoice choice;
  choice.size = static_cast<OidnSize>(std::lround(std::min(2.0, std::max(0.0, in.options.number(kNetwork)))));
  choice.prefilter = in.options.number(kPrefilter) != 0;
  choice.cancel = in.cancel;
  return choice;
}

class Oidn : public ExternalMethod {
 public:
  Oidn(const OidnApi* api, std::string reason, OidnWeights weights)
      : api_(weights.named ? nullptr : api), reason_(std::move(reason)), weights_(std::move(weights)) {}

  const char* name() const override { return "oidn"; }
  const char* description() const override {
    return "Open Image Denoise, a learned denoiser, where it is installed or its weights are (--oidn-weights)";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.halves = needs.variance = false;
    return needs;
  }
  std::vector<OptionInfo> options() const override { return {kNetwork, kPrefilter}; }
  MethodMemory memory(const MemoryCase& of) const override;
  std::string skipReason() const override;
  MethodResult run(const MethodInputs& in) const override;

 private:
  Denoise denoiser(const MethodInputs& in) const;

  const OidnApi* api_;  // null: by the weights
  std::string reason_;
  OidnWeights weights_;
};

MethodMemory Oidn::memory(const MemoryCase& /*of*/) const {
  // The library's own memory is not known.
  if (api_) return {96, 36};
  // One half is made beside the other, the mean and its encoded radiance. Of the weights, which all threads share, each
  // gets a part: right to 10 % for one thread and for many.
  constexpr uint64_t kWeights = uint64_t(12) << 20;
  MethodMemory memory{48, 36};
  memory.eachThread = kTileBytes + kConvolutionScratch + kWeights;
  return memory;
}

std::string Oidn::skipReason() const {
  if (api_) return {};
  if (weights_.folder.empty()) return reason_;
  std::error_code ignored;
  if (!std::filesystem::is_directory(weights_.folder, ignored))
    return weights_.folder + ": there is no such folder of weights: fetch them with tools/setup oidn";
  std::string reason;
  return openConvolutions(reason) ? "" : reason;
}

Denoise Oidn::denoiser(const MethodInputs& in) const {
  if (api_)
    return [device = std::make_shared<OidnDevice>(*api_)](const auto& colour, const auto* albedo, const auto* normal) {
      return device->denoise(colour, albedo, normal);
    };
  std::string reason = reason_;
  const ConvolutionLibrary* library = weights_.folder.empty() ? nullptr : openConvolutions(reason);
  if (!library) throw Error(ExitCode::Usage, reason);
  return [networks = std::make_shared<OidnNetworks>(weights_.folder, choiceOf(in), *library)](
             const auto& colour, const auto* albedo, const auto* normal) {
    return networks->denoise(colour, albedo, normal);
  };
}

// A half is denoised with that half of the features, so that it stays independent of the other one.
MethodResult Oidn::run(const MethodInputs& in) const {
  const Denoise denoise = denoiser(in);
  const FeaturePlanes<Rgb<float>>* albedo = in.features ? &in.features->albedo : nullptr;
  const FeaturePlanes<Rgb<float>>* normal = in.features ? &in.features->normal : nullptr;
  MethodResult result;
  const std::string network =
      api_ ? "library" : oidnNetworkName(choiceOf(in), featureImage(albedo, -1), featureImage(normal, -1));
  result.remarks.push_back(textAttribute("network", network));
  result.image.mean = denoise(in.unbiased->mean, featureImage(albedo, -1), featureImage(normal, -1));
  for (int h = 0; h < 2; ++h)
    if (!in.meanOnly && !in.unbiased->half[h].empty() && !in.cancelled())
      result.image.half[h] = denoise(in.unbiased->half[h], featureImage(albedo, h), featureImage(normal, h));
  return result;
}

}  // namespace

std::unique_ptr<Method> makeOidn(const OidnApi* api, const std::string& reason, const OidnWeights& weights) {
  return std::make_unique<Oidn>(api, reason, weights);
}

std::unique_ptr<Method> make_oidn() {
  std::string reason;
  const OidnApi* api = loadOidn("", reason);
  return makeOidn(api, reason + ", and there are no weights of it: tools/setup oidn fetches them", findOidnWeights());
}

}  // namespace braid
