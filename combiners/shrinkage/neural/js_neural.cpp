// SPDX-License-Identifier: Apache-2.0
// "js-neural": the James-Stein combiner with the network of the paper (combiners/README.md, James-Stein). Beside js it
// has the noise of a block from a weighted mean of the variances in it, whose weights the network says, and the share
// of either fit in Y*. Everything else is js.
#include <array>
#include <utility>

#include <fmt/format.h>

#include "combiners/learned/network_place.h"
#include "combiners/learned/planes/window_cells.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "combiners/pixels/mirror.h"
#include "combiners/shrinkage/james_stein.h"
#include "combiners/shrinkage/neural/learned_noise.h"
#include "renderer/core/parallel.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kNoisePlanes{"js-neural-planes", 0,
                              "1: the image is that of js; --weights writes what the network would read"};
const OptionInfo kNoiseLimit{"js-neural-limit",
                             1.5,
                             "Most noise of a block, relative to the mean variance in it; 0: no limit (the paper)",
                             0,
                             100,
                             false};

constexpr int kJsPlanes = 12;          // X, its deviation and the two fits
constexpr int kBlockRadius = 7;        // as in JamesSteinSettings
constexpr float kLeastWeight = 1e-4f;  // released code

using RgbPlanes = std::array<Plane<float>, 3>;

// What is in the sums of blocks: nothing of lone fireflies.
RgbPlanes blockVariance(const ShrinkageImages& of) {
  RgbPlanes out;
  for (size_t c = 0; c < 3; ++c) out[c] = of.variance[c];
  if (of.scale.gate.empty()) return out;
  parallelChunks(of.x.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      if (isLoneFirefly(of.scale.gate, of.x, of.target, i))
        for (size_t c = 0; c < 3; ++c) out[c][i] = 0;
  });
  return out;
}

std::array<Plane<float>, kJsPlanes> planesOf(const ShrinkageImages& of, const RgbPlanes& noise) {
  std::array<Plane<float>, kJsPlanes> out;
  for (Plane<float>& plane : out) plane = Plane<float>(of.x.width(), of.x.height(), kUnfilled);
  parallelChunks(of.x.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const float target = of.target[c][i], half = of.fits.empty() ? 0 : 0.5f * of.fits[c][i];
        out[c][i] = compressedRadiance(of.x[c][i]);
        out[3 + c][i] = compressedError(noise[c][i], target);
        out[6 + c][i] = compressedRadiance(target + half);
        out[9 + c][i] = compressedRadiance(target - half);
      }
  });
  return out;
}

LearnedShrinkage unlearned(const RgbPlanes& noise) {
  LearnedShrinkage out;
  for (size_t c = 0; c < 3; ++c) out.variance[c] = mirrorBoxMean<float>(noise[c], kBlockRadius);
  out.blend = Plane<float>(noise[0].width, noise[0].height, 0.5f);
  return out;
}

LearnedShrinkage learned(ShrinkageNetwork& by, const ShrinkageImages& of, double limit,
                         const std::atomic<bool>* cancel) {
  const RgbPlanes noise = blockVariance(of);
  LearnedShrinkage out = unlearned(noise);
  const WindowCells cells(kBlockRadius, by.across);
  const auto stride = static_cast<size_t>(by.network->outputs());
  const auto write = [&](int y, int x0, int x1, const float* row) {
    const auto count = static_cast<size_t>(x1 - x0);
    std::vector<float> weights(row, row + count * stride), means(count);
    for (float& w : weights) w = std::max(w, 0.0f) + kLeastWeight;
    for (size_t c = 0; c < 3; ++c) {
      cells.means(noise[c], y, x0, x1, {weights.data(), stride}, means.data());
      float* to = &out.variance[c].at(x0, y);
      for (size_t i = 0; i < count; ++i)
        to[i] = limit > 0
                    ? static_cast<float>(std::min(static_cast<double>(means[i]), limit * static_cast<double>(to[i])))
                    : means[i];
    }
    for (size_t i = 0; i < count; ++i)
      out.blend.at(x0 + static_cast<int>(i), y) =
          1 / (1 + std::exp(-std::clamp(row[i * stride + stride - 1], -60.0f, 60.0f)));
  };
  by.network->run(planesOf(of, noise), write, cancel);
  return out;
}

// What training reads: the planes; the variances; what is kept of the unbiased image at least, of blocks and, where it
// is not negative, of lone fireflies.
LearnedShrinkage written(const ShrinkageImages& of, std::vector<NamedPlane>& planes) {
  const RgbPlanes noise = blockVariance(of);
  if (of.half) return unlearned(noise);
  const auto add = [&](const Plane<float>& plane) {
    planes.push_back({fmt::format("js-neural.{:02}", planes.size()), plane});
  };
  for (const Plane<float>& plane : planesOf(of, noise)) add(plane);
  for (size_t c = 0; c < 3; ++c) add(noise[c]);
  const Plane<float> none(of.x.width(), of.x.height());
  for (size_t c = 0; c < 3; ++c) add(of.least ? of.least->blocks[c] : none);
  for (size_t c = 0; c < 3; ++c) {
    Plane<float> fireflies(of.x.width(), of.x.height(), -1.0f);
    for (size_t i = 0; i < fireflies.size(); ++i)
      if (isLoneFirefly(of.scale.gate, of.x, of.target, i))
        fireflies[i] = of.least && !of.least->fireflies[c].empty() ? of.least->fireflies[c][i] : 0;
    add(fireflies);
  }
  return unlearned(noise);
}

class NeuralJamesStein : public ExternalMethod {
 public:
  const char* name() const override { return "js-neural"; }
  const char* description() const override {
    return "James-Stein shrinkage with a network for the noise of blocks and for the fit";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return jamesSteinNeeds(); }
  std::string skipReason() const override { return networkSkipReason(name()); }
  MethodMemory memory(const MemoryCase& of) const override {
    constexpr int kMore = 80;
    constexpr uint64_t kWeights = uint64_t(2) << 20;
    MethodMemory memory = jamesSteinMemory(of);
    memory.peak += kMore;
    memory.eachThread += kTileBytes + kConvolutionScratch + kWeights;
    return memory;
  }
  std::vector<OptionInfo> options() const override {
    std::vector<OptionInfo> list = commonJamesSteinOptions();
    list.insert(list.end(), {kNoiseLimit, kNoisePlanes});
    return list;
  }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult NeuralJamesStein::run(const MethodInputs& in) const {
  if (in.options.number(kNoisePlanes) != 0) {
    std::vector<NamedPlane> planes;
    const ShrinkageModel model = [&](const ShrinkageImages& of) { return written(of, planes); };
    MethodResult result = runJamesStein(in, &model);
    result.aovs = std::move(planes);
    result.remarks.push_back(numberAttribute("js-neural-exposure", in.options.number(kPipelineExposure)));
    return result;
  }
  ShrinkageNetwork network = openShrinkageNetwork(name(), kJsPlanes, 1, kBlockRadius);
  const double limit = in.options.number(kNoiseLimit);
  const ShrinkageModel model = [&](const ShrinkageImages& of) { return learned(network, of, limit, in.cancel); };
  return runJamesStein(in, &model);
}

}  // namespace

std::unique_ptr<Method> make_js_neural() { return std::make_unique<NeuralJamesStein>(); }

}  // namespace braid
