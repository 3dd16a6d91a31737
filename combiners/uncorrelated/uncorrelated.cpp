// SPDX-License-Identifier: Apache-2.0
// Input-dependent uncorrelated weighting: an unbiased image of independent pixels and an unbiased image of correlated
// ones, whose differences are better than its pixels, make one with less noise and hardly any bias
// (combiners/README.md, Uncorrelated weighting).
//
// gamma is the candidate whose results differ least between two halves of the samples. Where the correlated image was
// reconstructed from the samples of the independent one (gradients), each half of the one is combined with the other
// half of the other, and the results are averaged. Fireflies are shared out first, and halves say how much of the
// combination to take (combiners/EXPERIMENTS.md, Sharing out fireflies; The rest of uncorrelated weighting).
#include <algorithm>
#include <optional>

#include "combiners/pixels/finite_float.h"
#include "combiners/pipeline/registry.h"
#include "combiners/statistics/variance.h"
#include "combiners/uncorrelated/uncorrelated_groups.h"
#include "combiners/uncorrelated/uncorrelated_noise.h"
#include "combiners/uncorrelated/uncorrelated_share.h"

namespace braid {

namespace {

const OptionInfo kGamma = gammaOption("uncorrelated");

const OptionInfo kMostNoise{"uncorrelated-most-noise",
                            224,
                            "Most variance of one pixel of a pair, in units of the other's; 0: any (paper)",
                            0,
                            1e30,
                            false};

const OptionInfo kMeasured{
    "uncorrelated-measured", 1,
    "1: take of the combination what its halves show to be of use, and the plain mean of both images for the "
    "rest; 0: all of it (paper)"};

const OptionInfo kShareOut{"uncorrelated-share-out", 1,
                           "1: share fireflies out among many pixels first, losing no light; 0: the paper"};

class Uncorrelated : public Method {
 public:
  const char* name() const override { return "uncorrelated"; }
  const char* description() const override {
    return "Independent and correlated image with input-dependent weights, nearly unbiased";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override { return uncorrelatedNeeds(); }
  // 264 of it only where there are fireflies.
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {340, 40}; }
  std::vector<OptionInfo> options() const override { return {kGamma, kMostNoise, kMeasured, kShareOut}; }
  MethodResult run(const MethodInputs& in) const override;
};

std::optional<SharedOut> sharedOut(const Estimate& image, const Estimate& other, const MethodOptions& options) {
  if (options.number(kShareOut) == 0 || image.variance.empty()) return {};
  return takeFirefliesOut(image, other.mean);
}

// Adds what was shared out, of which as much is kept as of any other light of its image.
void addShared(Rgb<float>& combined, const Rgb<float>* ofY, const Rgb<float>* ofZ, const PlainMean& mean,
               const std::array<Plane<float>, 3>& share) {
  if (!ofY && !ofZ) return;
  const Rgb<float> nothing(combined.width(), combined.height());
  if (!ofY) ofY = &nothing;
  Rgb<float> light = *ofY;
  if (!share[0].empty()) takeShare(light, mean, *ofY, ofZ ? *ofZ : nothing, share);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(combined.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) combined[c][i] = finiteFloat(combined[c][i] + light[c][i]);
    });
}

MethodResult Uncorrelated::run(const MethodInputs& in) const {
  const std::optional<SharedOut> ofY = sharedOut(*in.unbiased, *in.correlated, in.options);
  const std::optional<SharedOut> ofZ = sharedOut(*in.correlated, *in.unbiased, in.options);
  const Estimate &y = ofY ? ofY->image : *in.unbiased, &z = ofZ ? ofZ->image : *in.correlated;
  // Halves of images that share samples are crossed: half A of y meets half B of z, whose quarters make the weights.
  const size_t swap = z.correlation == Correlation::Gradients ? 1 : 0;
  NoiseChoice noise;
  noise.most = std::clamp(in.options.number(kMostNoise), 0.0, 1e30);
  const Rgb<float> levels = differenceNoiseLevels(y, z);
  if (noise.most > 0 && !levels.empty()) noise.levels = &levels;
  const UncorrelatedInputs groups[2] = {uncorrelatedGroup(y, z, 0, swap, swap, noise),
                                        uncorrelatedGroup(y, z, 1, 1 - swap, 1 - swap, noise)};
  MethodResult result;
  const double gamma = filterGroups(in, kGamma, groups, result);
  Estimate& out = result.image;
  std::array<Plane<float>, 3> share;
  const bool measured = in.options.number(kMeasured) != 0;
  // Where they share samples, z brings nothing new to a plain mean.
  const PlainMean mean = measured && !swap ? plainMean(y, z) : PlainMean{y, z, {}};
  if (measured) {
    share = combinedShares(mean, out.half, levels);
    for (size_t h = 0; h < 2; ++h) takeShare(out.half[h], mean, y.half[h], z.half[h], share);
  }
  for (size_t h = 0; h < 2; ++h)
    addShared(out.half[h], ofY ? &ofY->half[h] : nullptr, ofZ ? &ofZ->half[h] : nullptr, mean, share);
  if (swap) {
    out.mean = average(out.half[0], out.half[1]);
    // Both have seen all samples: no halves that are independent of each other, and no error from their difference.
    out.half[0] = out.half[1] = {};
  } else {
    const double samples = static_cast<double>(passesOf(z)) / 2;
    out.mean =
        uncorrelatedFiltered({&y.mean, &z.mean, &z.half[0], &z.half[1], samples, noise.levels, noise.most}, gamma);
    if (measured) takeShare(out.mean, mean, y.mean, z.mean, share);
    addShared(out.mean, ofY ? &ofY->mean : nullptr, ofZ ? &ofZ->mean : nullptr, mean, share);
    result.error = halvesVariance(out.half);
  }
  return result;
}

}  // namespace

std::unique_ptr<Method> make_uncorrelated() { return std::make_unique<Uncorrelated>(); }

}  // namespace braid
