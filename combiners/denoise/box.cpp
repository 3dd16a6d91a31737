// SPDX-License-Identifier: Apache-2.0
// The mean over 15x15 pixels: the severely biased input that combiners are tested with. It blurs every edge and texture
// and spreads every firefly, so a combiner that trusts it shows at once.
#include "combiners/pixels/box_mean.h"
#include "combiners/pipeline/registry.h"

namespace braid {

namespace {

const OptionInfo kRadius{"box-radius", 7, "Radius of the box filter in pixels", 0, 1000};

Rgb<float> boxFiltered(const Rgb<float>& in, int radius) {
  Rgb<float> out(in.width(), in.height());
  for (size_t c = 0; c < 3; ++c) {
    const Plane<double> mean = boxMean(in[c], radius);
    parallelChunks(mean.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] = static_cast<float>(mean[i]);
    });
  }
  return out;
}

class Box : public Method {
 public:
  const char* name() const override { return "box"; }
  const char* description() const override { return "Mean over 15x15 pixels: severely biased, for stress tests"; }
  MethodKind kind() const override { return MethodKind::Denoiser; }
  Needs needs() const override {
    Needs needs;
    needs.passes = 1;
    needs.halves = needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {48, 36}; }
  std::vector<OptionInfo> options() const override { return {kRadius}; }

  MethodResult run(const MethodInputs& in) const override {
    const int radius = static_cast<int>(std::clamp(in.options.number(kRadius), 0.0, 1000.0));
    MethodResult result;
    result.image.mean = boxFiltered(in.unbiased->mean, radius);
    for (int h = 0; h < 2 && !in.meanOnly; ++h) result.image.half[h] = boxFiltered(in.unbiased->half[h], radius);
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_box() { return std::make_unique<Box>(); }

}  // namespace braid
