// SPDX-License-Identifier: Apache-2.0
// The plain mean of all bases: what every ensemble has to beat.
#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// Empty when one of the images is.
Rgb<float> meanOf(const std::vector<const Rgb<float>*>& images) {
  for (const Rgb<float>* image : images)
    if (image->empty()) return {};
  Rgb<float> out(images[0]->width(), images[0]->height());
  const auto count = static_cast<double>(images.size());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        double sum = 0;
        for (const Rgb<float>* image : images) sum += static_cast<double>((*image)[c][i]);
        out[c][i] = static_cast<float>(sum / count);
      }
    });
  return out;
}

class Average : public Method {
 public:
  const char* name() const override { return "average"; }
  const char* description() const override { return "Plain mean of the bases, the baseline of ensembles"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.bases = 2;
    needs.passes = 1;
    needs.halves = needs.variance = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {36, 36}; }

  MethodResult run(const MethodInputs& in) const override {
    const auto collect = [&in](auto get) {
      std::vector<const Rgb<float>*> images;
      for (const Estimate* base : in.bases) images.push_back(get(*base));
      return meanOf(images);
    };
    MethodResult result;
    result.image.mean = collect([](const Estimate& e) { return &e.mean; });
    for (int h = 0; h < 2; ++h) result.image.half[h] = collect([h](const Estimate& e) { return &e.half[h]; });
    return result;
  }
};

}  // namespace

std::unique_ptr<Method> make_average() { return std::make_unique<Average>(); }

}  // namespace braid
