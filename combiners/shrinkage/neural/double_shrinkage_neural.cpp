// SPDX-License-Identifier: Apache-2.0
// "double-shrinkage-neural": DSCombiner with the network of the paper (combiners/README.md, Double shrinkage). Beside
// double-shrinkage it has both squared errors from weighted means of what the pixels say, whose weights the network
// says, and the error of the prior. Everything else is double-shrinkage.
#include <array>
#include <utility>

#include <fmt/format.h>

#include "combiners/learned/network_place.h"
#include "combiners/learned/planes/window_cells.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "combiners/pixels/channel_mean.h"
#include "combiners/shrinkage/double_shrinkage.h"
#include "combiners/shrinkage/neural/learned_noise.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kErrorPlanes{"double-shrinkage-neural-planes", 0,
                              "1: the image is that of double-shrinkage; --weights writes what the network would read"};
const OptionInfo kErrorLimit{
    "double-shrinkage-neural-limit",
    2,
    "How many times less error of the biased image and of the prior, and more of the unbiased image, the network may "
    "say than double-shrinkage measures; 0: any number of times (the paper)",
    0,
    1e6,
    false};

constexpr int kErrorPlaneCount = 11;  // the three images, E_u and E_b
constexpr int kErrorRadius = 6;
constexpr float kDarkPrior = 0.01f;  // squared brightness below which the prior's error stops being relative

std::array<Plane<float>, kErrorPlaneCount> planesOf(const ErrorImages& of, const Plane<float>& level) {
  std::array<Plane<float>, kErrorPlaneCount> out;
  for (Plane<float>& plane : out) plane = Plane<float>(level.width, level.height, kUnfilled);
  parallelChunks(level.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        out[c][i] = compressedRadiance(of.unbiased[c][i]);
        out[3 + c][i] = compressedRadiance(of.biased[c][i]);
        out[6 + c][i] = compressedRadiance(of.prior[c][i]);
      }
      out[9][i] = compressedError(of.samples.unbiased[i], level[i]);
      out[10][i] = compressedError(of.samples.biased[i], level[i]);
    }
  });
  return out;
}

// Softmax, in place.
void toWeights(float* of, size_t count) {
  const float most = *std::max_element(of, of + count);
  for (size_t i = 0; i < count; ++i) of[i] = std::exp(std::max(of[i] - most, -60.0f));
}

// One row of what the network says, and where it goes.
struct ErrorRow {
  const ErrorImages& of;
  const Plane<float>& level;
  const WindowCells& cells;
  double limit;

  void write(int y, int x0, int x1, std::vector<float>& row, ShrinkageErrors& out) const {
    const auto count = static_cast<size_t>(x1 - x0), kernel = static_cast<size_t>(cells.count());
    const size_t stride = 2 * kernel + 1, first = level.index(x0, y);
    for (size_t i = 0; i < count; ++i)
      for (size_t k = 0; k < 2; ++k) toWeights(&row[i * stride + k * kernel], kernel);
    cells.means(of.samples.unbiased, y, x0, x1, {row.data(), stride}, &out.unbiased[first]);
    cells.means(of.samples.biased, y, x0, x1, {row.data() + kernel, stride}, &out.biased[first]);
    for (size_t i = 0; i < count; ++i) {
      const size_t p = first + i;
      const float relative = std::exp(std::clamp(row[i * stride + stride - 1], -30.0f, 10.0f));
      out.prior[p] = finiteFloat(static_cast<double>(relative) *
                                 (sqr(static_cast<double>(level[p])) + static_cast<double>(kDarkPrior)));
      // Errors of nothing would be weights without end.
      const double tiny = 1e-8 * (sqr(static_cast<double>(level[p])) + 1e-4);
      const auto raise = [&](float& value, double least) {
        value = finiteFloat(std::max(static_cast<double>(value), least));
      };
      raise(out.unbiased[p], tiny);
      raise(out.biased[p], tiny);
      raise(out.prior[p], 1e-6 * (sqr(static_cast<double>(level[p])) + static_cast<double>(kDarkPrior)));
      if (limit <= 0) continue;
      const double most = limit * static_cast<double>(of.filtered.unbiased[p]);
      out.unbiased[p] = finiteFloat(std::min(static_cast<double>(out.unbiased[p]), most));
      raise(out.biased[p], static_cast<double>(of.filtered.biased[p]) / limit);
      raise(out.prior[p], static_cast<double>(of.filtered.prior[p]) / limit);
    }
  }
};

ShrinkageErrors learned(ShrinkageNetwork& by, const ErrorImages& of, double limit, const std::atomic<bool>* cancel) {
  const Plane<float> level = channelMean(of.prior);
  ShrinkageErrors out = of.filtered;
  const WindowCells cells(kErrorRadius, by.across);
  const ErrorRow to{of, level, cells, limit};
  const auto stride = static_cast<size_t>(by.network->outputs());
  by.network->run(
      planesOf(of, level),
      [&](int y, int x0, int x1, const float* said) {
        std::vector<float> row(said, said + static_cast<size_t>(x1 - x0) * stride);
        to.write(y, x0, x1, row, out);
      },
      cancel);
  return out;
}

// What training reads: the planes; both errors as the pixels say them; all three as double-shrinkage measures them.
ShrinkageErrors written(const ErrorImages& of, std::vector<NamedPlane>& planes) {
  const auto add = [&](const Plane<float>& plane) {
    planes.push_back({fmt::format("double-shrinkage-neural.{:02}", planes.size()), plane});
  };
  for (const Plane<float>& plane : planesOf(of, channelMean(of.prior))) add(plane);
  for (const Plane<float>* plane :
       {&of.samples.unbiased, &of.samples.biased, &of.filtered.unbiased, &of.filtered.biased, &of.filtered.prior})
    add(*plane);
  return of.filtered;
}

class NeuralDoubleShrinkage : public ExternalMethod {
 public:
  const char* name() const override { return "double-shrinkage-neural"; }
  const char* description() const override {
    return "Double shrinkage with a network for the errors of the unbiased image, the biased one and the prior";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return doubleShrinkageNeeds(); }
  std::string skipReason() const override { return networkSkipReason(name()); }
  MethodMemory memory(const MemoryCase& of) const override {
    constexpr int kMore = 20;
    constexpr uint64_t kWeights = uint64_t(2) << 20;
    MethodMemory memory = doubleShrinkageMemory(of);
    memory.peak += kMore;
    memory.eachThread += kTileBytes + kConvolutionScratch + kWeights;
    return memory;
  }
  std::vector<OptionInfo> options() const override {
    std::vector<OptionInfo> list = commonDoubleShrinkageOptions();
    list.insert(list.end(), {kErrorLimit, kErrorPlanes});
    return list;
  }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult NeuralDoubleShrinkage::run(const MethodInputs& in) const {
  if (in.options.number(kErrorPlanes) != 0) {
    std::vector<NamedPlane> planes;
    const ErrorModel model = [&](const ErrorImages& of) { return written(of, planes); };
    MethodResult result = runDoubleShrinkage(in, &model);
    result.aovs = std::move(planes);
    result.remarks.push_back(numberAttribute("double-shrinkage-neural-exposure", in.options.number(kPipelineExposure)));
    return result;
  }
  ShrinkageNetwork network = openShrinkageNetwork(name(), kErrorPlaneCount, 2, kErrorRadius);
  const double limit = in.options.number(kErrorLimit);
  const ErrorModel model = [&](const ErrorImages& of) { return learned(network, of, limit, in.cancel); };
  return runDoubleShrinkage(in, &model);
}

}  // namespace

std::unique_ptr<Method> make_double_shrinkage_neural() { return std::make_unique<NeuralDoubleShrinkage>(); }

}  // namespace braid
