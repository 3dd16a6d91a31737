// SPDX-License-Identifier: Apache-2.0
// Kernel prediction: a network chooses how far each pixel averages its neighbours, at several scales.
#include <cmath>

#include <fmt/format.h>

#include "combiners/denoise/kpn/kpn_network.h"
#include "combiners/learned/network_place.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/variance.h"
#include "renderer/core/error.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kPlanes{"kpn-planes", 0, "1: the image stays as it is; --weights writes what the network would read"};

constexpr float kSameRadiance = 2e-3f;  // relative, for features in half precision

// With halves of their own weights, but features and variances of all samples, like those of pw.
class Kpn : public ExternalMethod {
 public:
  const char* name() const override { return "kpn"; }
  const char* description() const override {
    return "Kernel prediction: a network of braid's own chooses whom each pixel averages, at six scales";
  }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.halves = false;
    return needs;
  }
  std::vector<OptionInfo> options() const override { return {kPlanes}; }
  MethodMemory memory(const MemoryCase& /*of*/) const override {
    constexpr uint64_t kWeights = uint64_t(4) << 20;
    MethodMemory memory{260, 36};
    memory.eachThread = kTileBytes + kConvolutionScratch + kWeights;
    return memory;
  }
  std::string skipReason() const override { return networkSkipReason(name()); }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult planesOf(const MethodInputs& in, KpnPlanes planes) {
  MethodResult result;
  result.image.mean = in.unbiased->mean;
  result.remarks.push_back(numberAttribute("kpn-exposure", in.options.number(kPipelineExposure)));
  for (size_t k = 0; k < planes.input.size(); ++k)
    result.aovs.push_back({fmt::format("kpn.{:02}", k), std::move(planes.input[k])});
  result.aovs.push_back({"kpn.variance", std::move(planes.variance)});
  return result;
}

// Where rays miss, the albedo is the environment that they see, sample by sample. Such pixels have no noise and stay as
// they are, for averages can only blur them. `albedo`: of the same samples as the image.
void keepMisses(Rgb<float>& out, const Rgb<float>& image, const Rgb<float>& albedo, const MethodInputs& in) {
  const Plane<float>& depth = in.features->depth.mean;
  if (depth.empty() || albedo.empty() || out.empty()) return;
  const auto exposure = static_cast<float>(in.options.number(kPipelineExposure));
  for (size_t i = 0; i < image.size(); ++i) {
    bool seen = depth[i] == 0;
    for (size_t c = 0; c < 3 && seen; ++c) {
      const float sky = exposure * albedo[c][i];
      seen = sky > 0 && std::abs(image[c][i] - sky) <= kSameRadiance * sky;
    }
    for (size_t c = 0; c < 3 && seen; ++c) out[c][i] = image[c][i];
  }
}

MethodResult Kpn::run(const MethodInputs& in) const {
  const Estimate& e = *in.unbiased;
  const KpnScene scene{in.features, regularisedVariance(e), in.firstPass ? 1 : e.passes};
  if (scene.variance.empty())
    throw Error(ExitCode::BadInput, "kpn needs the variance of its input, or the halves of at least two passes");
  if (in.options.number(kPlanes) != 0) return planesOf(in, kpnPlanes(e.mean, scene, false));
  std::string reason;
  const ConvolutionLibrary* library = openConvolutions(reason);
  if (!library) throw Error(ExitCode::Usage, reason);
  KpnNetwork network(findNetwork(name()), *library);
  MethodResult result;
  result.image.mean = network.denoise(kpnPlanes(e.mean, scene, false), in.cancel);
  if (in.features) keepMisses(result.image.mean, e.mean, in.features->albedo.mean, in);
  for (int h = 0; h < 2; ++h)
    if (!in.meanOnly && !e.half[h].empty() && !in.cancelled()) {
      result.image.half[h] = network.denoise(kpnPlanes(e.half[h], scene, true), in.cancel);
      if (in.features) keepMisses(result.image.half[h], e.half[h], in.features->albedo.half[h], in);
    }
  return result;
}

}  // namespace

std::unique_ptr<Method> make_kpn() { return std::make_unique<Kpn>(); }

}  // namespace braid
