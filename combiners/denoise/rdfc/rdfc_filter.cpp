// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/rdfc/rdfc_filter.h"

#include <cmath>

#include "combiners/statistics/local_range_clamp.h"
#include "combiners/denoise/rdfc/rdfc_candidates.h"
#include "combiners/denoise/rdfc/rdfc_features.h"
#include "combiners/denoise/rdfc/rdfc_second_pass.h"
#include "combiners/denoise/rdfc/rdfc_window.h"
#include "combiners/pixels/least_albedo.h"
#include "combiners/statistics/variance.h"
#include "combiners/statistics/fireflies.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr float kLargest = 1e9f;
constexpr int kRescaleRadius = 10;
// Radius of the range of results, which the paper does not have (combiners/EXPERIMENTS.md, Range of alike pixels).
constexpr int kRange = 2;

float finiteOrZero(float v) { return std::isfinite(v) ? std::clamp(v, -kLargest, kLargest) : 0.0f; }

// What the colour is divided by, per pixel and channel. The albedo of a miss is the radiance of the environment, that
// of an emitter contains its emission: these stay whole.
Rgb<float> divisors(const Features* features, int width, int height) {
  Rgb<float> out(width, height, 1.0f);
  if (!features || features->albedo.mean.empty()) return out;
  const Rgb<float>& albedo = features->albedo.mean;
  const Plane<float>& depth = features->depth.mean;
  for (size_t i = 0; i < out.size(); ++i) {
    const Vec3 a(finiteOrZero(albedo[0][i]), finiteOrZero(albedo[1][i]), finiteOrZero(albedo[2][i]));
    if (maxComponent(a) > 1 || (!depth.empty() && depth[i] == 0)) continue;
    out.set(i, glm::max(a, Vec3(kLeastAlbedo)));
  }
  return out;
}

// What is filtered: the mean, its variance, and the images that it is made of, as in RdfcColour.
struct Colour {
  Rgb<float> mean, variance, divisor;
  std::vector<Rgb<float>> images;
  std::vector<float> shares;
};

Rgb<float> weightedSum(const std::vector<Rgb<float>>& images, const std::vector<float>& shares) {
  Rgb<float> out(images[0].width(), images[0].height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t k = 0; k < images.size(); ++k)
        for (size_t i = begin; i < end; ++i) out[c][i] += shares[k] * images[k][c][i];
    });
  return out;
}

// Whether the images add up to the mean but for rounding. Images from elsewhere may come with other halves.
bool addUp(const Colour& colour) {
  const Rgb<float> sum = weightedSum(colour.images, colour.shares);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < sum.size(); ++i)
      if (!(std::fabs(sum[c][i] - colour.mean[c][i]) <= 1e-3f * std::fabs(colour.mean[c][i]) + 1e-6f)) return false;
  return true;
}

// Cleaned, and divided by the divisor.
Rgb<float> prepared(const Rgb<float>& image, const Rgb<float>& divisor) {
  Rgb<float> out = image;
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] = finiteOrZero(out[c][i]) / divisor[c][i];
    });
  return out;
}

Colour colourOf(const Estimate& e, const Features* features, const RdfcOptions& options) {
  Colour colour;
  colour.divisor = divisors(options.demodulate ? features : nullptr, e.mean.width(), e.mean.height());
  colour.mean = prepared(e.mean, colour.divisor);
  colour.variance = rdfcVariance(e, options.variance);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < colour.variance.size(); ++i)
      colour.variance[c][i] =
          std::min(colour.variance[c][i], kLargest * kLargest) / (colour.divisor[c][i] * colour.divisor[c][i]);
  if (!e.half[0].empty() && !e.half[1].empty()) {
    const uint64_t n = passesOf(e);
    const auto shareA = static_cast<float>(static_cast<double>((n + 1) / 2) / static_cast<double>(n));
    colour.images = {prepared(e.half[0], colour.divisor), prepared(e.half[1], colour.divisor)};
    colour.shares = {shareA, 1 - shareA};
  }
  if (colour.images.empty() || !addUp(colour)) {
    colour.images.insert(colour.images.begin(), colour.mean);
    colour.shares.assign(colour.images.size(), 0.0f);
    colour.shares[0] = 1;
  }
  return colour;
}

RdfcColour mirrored(const Colour& colour) {
  RdfcColour out;
  for (size_t c = 0; c < 3; ++c)
    out.guide.push_back({MirroredPlane(colour.mean[c]), MirroredPlane(colour.variance[c]), {}});
  for (const Rgb<float>& image : colour.images)
    out.images.push_back({MirroredPlane(image[0]), MirroredPlane(image[1]), MirroredPlane(image[2])});
  out.shares = colour.shares;
  return out;
}

// Planes filtered along the colour.
std::vector<Plane<float>> filteredAlong(const RdfcGuide& colour, int window, const std::vector<const Plane<float>*>& in,
                                        const std::atomic<bool>* cancel) {
  std::vector<MirroredPlane> targets;
  for (const Plane<float>* p : in) targets.emplace_back(*p);
  RdfcWindowFilter filter;
  filter.guide = &colour;
  filter.window = window;
  return rdfcFiltered(filter, targets, cancel);
}

// Which candidate has the least risk. The first must also depend less on the pixel's own noise than the second.
size_t bestCandidate(const std::vector<RdfcCandidate>& candidates, const std::vector<Plane<float>>& risk, size_t i) {
  size_t best = candidates.size() - 1;
  for (size_t k = best; k-- > 0;) {
    if (k == 0 && !(candidates[0].derivative[i] <= candidates[1].derivative[i])) continue;
    if (risk[k][i] < risk[best][i]) best = k;
  }
  return best;
}

struct Selection {
  std::vector<Plane<float>> risk, share;
};

Selection selectionOf(const RdfcGuide& colour, const std::vector<RdfcCandidate>& candidates,
                      const std::atomic<bool>* cancel) {
  Selection s;
  std::vector<const Plane<float>*> planes;
  for (const RdfcCandidate& c : candidates) planes.push_back(&c.risk);
  s.risk = filteredAlong(colour, 1, planes, cancel);
  std::vector<Plane<float>> binary(candidates.size(), Plane<float>(s.risk[0].width, s.risk[0].height));
  for (size_t i = 0; i < binary[0].size(); ++i) binary[bestCandidate(candidates, s.risk, i)][i] = 1;
  for (size_t k = 0; k < binary.size(); ++k) planes[k] = &binary[k];
  s.share = filteredAlong(colour, 5, planes, cancel);
  parallelChunks(binary[0].size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float sum = 0;
      for (const Plane<float>& share : s.share) sum += share[i];
      for (Plane<float>& share : s.share)
        share[i] = sum > 0 ? share[i] / sum : 1.0f / static_cast<float>(s.share.size());
    }
  });
  return s;
}

std::vector<Rgb<float>> blended(const std::vector<RdfcCandidate>& candidates, const std::vector<Plane<float>>& share) {
  std::vector<Rgb<float>> out(candidates[0].images.size(), Rgb<float>(share[0].width, share[0].height));
  for (size_t image = 0; image < out.size(); ++image)
    for (size_t c = 0; c < 3; ++c)
      parallelChunks(share[0].size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t k = 0; k < candidates.size(); ++k)
          for (size_t i = begin; i < end; ++i) out[image][c][i] += share[k][i] * candidates[k].images[image][c][i];
      });
  return out;
}

std::vector<Rgb<float>> secondPass(const std::vector<Rgb<float>>& images, const std::vector<float>& shares,
                                   const std::vector<RdfcGuide>& features, uint64_t passes,
                                   const std::atomic<bool>* cancel) {
  std::vector<const Rgb<float>*> all;
  for (const Rgb<float>& image : images) all.push_back(&image);
  return rdfcSecondPass(all, weightedSum(images, shares), features, passes, {}, cancel);
}

Plane<float> blendedRisk(const Selection& s, const Rgb<float>& divisor) {
  Plane<float> out(divisor.width(), divisor.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float risk = 0, scale = 0;
      for (size_t k = 0; k < s.risk.size(); ++k) risk += s.share[k][i] * s.risk[k][i];
      for (size_t c = 0; c < 3; ++c) scale += divisor[c][i] * divisor[c][i] / 3;
      out[i] = scale * std::max(0.0f, risk);
    }
  });
  return out;
}

}  // namespace

Rgb<float> rdfcVariance(const Estimate& e, RdfcVariance kind) {
  const uint64_t n = passesOf(e);
  const bool halves = !e.half[0].empty() && !e.half[1].empty();
  if (kind == RdfcVariance::Shrunk || e.variance.empty() || n < 4 || (kind == RdfcVariance::Rescaled && !halves))
    return regularisedVariance(e);
  Rgb<float> out = e.variance;
  for (Plane<float>& plane : out.channel)
    for (float& v : plane.data) v = std::isfinite(v) && v > 0 ? v : 0.0f;
  if (kind == RdfcVariance::Sample) return out;
  const double a = static_cast<double>((n + 1) / 2), all = static_cast<double>(n);
  for (size_t c = 0; c < 3; ++c) {
    Plane<double> between(e.mean.width(), e.mean.height());
    for (size_t i = 0; i < between.size(); ++i) {
      const double d =
          static_cast<double>(finiteOrZero(e.half[0][c][i])) - static_cast<double>(finiteOrZero(e.half[1][c][i]));
      between[i] = a * (all - a) / (all * all) * d * d;
    }
    between = boxSum(between, kRescaleRadius);
    const Plane<double> within = boxSum(out[c], kRescaleRadius);
    for (size_t i = 0; i < between.size(); ++i)
      out[c][i] = static_cast<float>(within[i] > 0 ? static_cast<double>(out[c][i]) * (between[i] / within[i]) : 0.0);
  }
  return out;
}

RdfcResult rdfcDenoised(const Estimate& estimate, const Features* features, const RdfcOptions& options,
                        const std::atomic<bool>* cancel) {
  const uint64_t passes = passesOf(estimate);
  const Colour colour = options.removeFireflies
                            ? colourOf(withoutFireflies(estimate, options.quarters, features), features, options)
                            : colourOf(estimate, features, options);
  BRAID_ASSERT(!colour.variance.empty());
  const RdfcColour mirroredColour = mirrored(colour);
  const std::vector<RdfcGuide> guides = features ? rdfcFeatures(*features, passes, cancel) : std::vector<RdfcGuide>();

  const std::vector<RdfcCandidate> candidates = rdfcCandidates(mirroredColour, guides, cancel);
  Selection selection = selectionOf(mirroredColour.guide, candidates, cancel);
  std::vector<Rgb<float>> images = blended(candidates, selection.share);
  if (options.secondPass && images.size() >= 2) images = secondPass(images, colour.shares, guides, passes, cancel);

  std::vector<Rgb<float>*> filtered;
  std::vector<const Rgb<float>*> noisy;
  for (size_t k = 0; k < images.size(); ++k) {
    filtered.push_back(&images[k]);
    noisy.push_back(&colour.images[k]);
  }
  clampToLocalRange(filtered, noisy, colour.mean, colour.variance, kRange);
  for (Rgb<float>& image : images)
    for (size_t c = 0; c < 3; ++c)
      parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) image[c][i] *= colour.divisor[c][i];
      });
  RdfcResult result;
  result.risk = blendedRisk(selection, colour.divisor);
  result.selection = std::move(selection.share);
  result.mean = weightedSum(images, colour.shares);
  if (images.size() >= 2) {
    result.half[0] = std::move(images[images.size() - 2]);
    result.half[1] = std::move(images.back());
  }
  return result;
}

}  // namespace braid
