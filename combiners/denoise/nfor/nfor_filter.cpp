// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nfor/nfor_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/statistics/local_range_clamp.h"
#include "combiners/denoise/nfor/feature_prefilter.h"
#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/denoise/nlm/nlm_window_weights.h"
#include "combiners/statistics/variance.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kWindow = 9, kPatch = 3;        // of the regressions
constexpr int kMapWindow = 9, kMapPatch = 1;  // of error and selection maps
constexpr int kVarianceWindow = 5, kVariancePatch = 1;
constexpr double kRidge = 1e-3;
constexpr float kScaleOffset = 0.1f;
constexpr float kFallbackWeight = 0.25f;  // of the zero-order filter, where there is not a model for every pixel
constexpr int kRange = 1;                 // radius of the range of fits
constexpr float kLeastDivisor = 0.2f;     // added to the albedo

// The image of value(channel, pixel); values that are not finite are 0.
template <class Value>
Rgb<float> imageOf(int width, int height, const Value& value) {
  Rgb<float> out(width, height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const float v = value(c, i);
        out[c][i] = std::isfinite(v) ? v : 0.0f;
      }
  });
  return out;
}

// One guide a channel: of the weights the smallest over red, green and blue counts.
std::array<NlmGuide, 3> guidesOf(const Rgb<float>& image, const Rgb<float>& variance, float k, int patch) {
  std::array<NlmGuide, 3> guides;
  for (size_t c = 0; c < 3; ++c) guides[c] = nlmGuide(image[c], variance[c], k, patch);
  return guides;
}

// Each channel of `in` filtered along the same channel of the image.
Rgb<float> filteredByChannel(const std::array<NlmGuide, 3>& guides, int window, const Rgb<float>& in) {
  Rgb<float> out(in.width(), in.height());
  for (size_t c = 0; c < 3; ++c) {
    const std::array from = {&in[c]};
    const std::array to = {&out[c]};
    nlmFilter(std::span(&guides[c], 1), window, from, to);
  }
  return out;
}

// The colours that are filtered: those of the estimate, or divided by albedos. All images are divided by the same, lest
// the mean of the quotients be another image than the quotient of the means.
struct Colours {
  Rgb<float> mean, half[2], variance;  // variance of the mean
  Rgb<float> divisor;                  // empty: 1

  int width() const { return mean.width(); }
  int height() const { return mean.height(); }
};

Colours coloursOf(const Estimate& e, const Plane<float>* albedo) {
  const int width = e.mean.width(), height = e.mean.height();
  Colours out;
  if (albedo)
    out.divisor =
        imageOf(width, height, [&](size_t c, size_t i) { return std::max(albedo[c][i], 0.0f) + kLeastDivisor; });
  const auto quotient = [&](const Rgb<float>& of) {
    return imageOf(width, height, [&](size_t c, size_t i) { return albedo ? of[c][i] / out.divisor[c][i] : of[c][i]; });
  };
  out.mean = quotient(e.mean);
  for (size_t h = 0; h < 2; ++h) out.half[h] = quotient(e.half[h]);
  const Rgb<float> variance = meanVariance(e);
  out.variance = imageOf(width, height, [&](size_t c, size_t i) {
    const float v = std::max(0.0f, variance[c][i]);
    return albedo ? v / sqr(out.divisor[c][i]) : v;
  });
  return out;
}

// The variance of the mean that weights are based on.
Rgb<float> guideVariance(const Colours& colours, uint64_t passes, NforVariance kind) {
  if (kind == NforVariance::Sample) return colours.variance;
  if (kind == NforVariance::NonLocal)
    return filteredByChannel(guidesOf(colours.mean, colours.variance, 0.5f, kVariancePatch), kVarianceWindow,
                             colours.variance);
  Estimate e;
  e.passes = passes;
  e.variance = colours.variance;
  for (size_t h = 0; h < 2; ++h) e.half[h] = colours.half[h];
  return regularisedVariance(e);
}

// Regressions in one image: its offset planes, settings, and what was counted.
class Regressor {
 public:
  // Both outlive it: the noisy image and the variance of its mean.
  Regressor(const Rgb<float>& noisy, const Rgb<float>& variance, const NforOptions& options)
      : noisy_(noisy), variance_(variance) {
    const int width = noisy.width(), height = noisy.height();
    settings_.radius = kWindow;
    settings_.stride = options.stride;
    settings_.fallbackWeight = options.stride > 1 ? kFallbackWeight : 0;
    settings_.scaleOffset = kScaleOffset;
    settings_.ridgeKind = Ridge::RelativeToTrace;
    settings_.ridge = kRidge;
    settings_.cancel = options.cancel;
    if (!options.offsets) return;
    x_ = y_ = Plane<float>(width, height);
    parallelRows(height, [&](int y) {
      for (int x = 0; x < width; ++x) {
        x_.at(x, y) = static_cast<float>(x) / kWindow;
        y_.at(x, y) = static_cast<float>(y) / kWindow;
      }
    });
  }

  // The weights of an image of the given variance, k = 1 and 0.5. Both are doubled: the variance of a half is twice
  // that of the mean, and the last pass keeps the factor. `target` is what will be regressed, at both or at k = 1
  // alone.
  struct Weights {
    std::array<Rgb<float>, 2> zeroOrder;  // of the target; empty if there is a model for every pixel
    NlmWindowStore store;
  };
  Weights weights(const Rgb<float>& guide, const Rgb<float>& variance, const Rgb<float>& target, bool both) const {
    std::array<NlmGuide, 3> guides = guidesOf(guide, variance, 1, kPatch);
    for (NlmGuide& g : guides) g.varianceScale = 2;
    std::array<Rgb<float>, 2> zeroOrder;
    const bool strided = settings_.stride > 1;
    for (size_t k = 0; k < 2 && strided && (k == 0 || both); ++k)
      zeroOrder[k] = Rgb<float>(target.width(), target.height());
    NlmWindowStore store(guides, kWindow, settings_.stride, &target, strided ? &zeroOrder : nullptr);
    return {std::move(zeroOrder), std::move(store)};
  }

  Rgb<float> run(const Rgb<float>& target, const FeatureChannels& features, const Weights& weights,
                 bool halfSensitivity) {
    const NlmWindowWeights window(weights.store, halfSensitivity);
    RegressionInputs in;
    in.features = features.groups();
    if (x_.width > 1) in.features.push_back({&x_});
    if (y_.height > 1) in.features.push_back({&y_});
    in.terms = {{&target, &window, nullptr}};
    in.fallback = weights.zeroOrder[0].empty() ? &target : &weights.zeroOrder[halfSensitivity ? 1 : 0];
    Rgb<float> out = regress(in, settings_, &report);
    // Beside a small bright highlight, whose pixels look like anything because they are so noisy, linear fits run far
    // below and above all that is there.
    const std::array images = {&out};
    const std::array values = {&target};
    clampToLocalRange(images, values, noisy_, variance_, kRange);
    return out;
  }

  RegressionReport report;

 private:
  const Rgb<float>&noisy_, &variance_;
  RegressionSettings settings_;
  Plane<float> x_, y_;
};

// Both halves regressed with k = 1 [0] and k = 0.5 [1].
struct Candidates {
  Rgb<float> half[2][2];  // [half][bandwidth]
};

Candidates crossedCandidates(const Colours& colours, const Rgb<float>& variance, const FeatureHalves& features,
                             Regressor& regressor) {
  Candidates out;
  for (size_t h = 0; h < 2; ++h) {
    const Regressor::Weights weights = regressor.weights(colours.half[1 - h], variance, colours.half[h], true);
    for (size_t k = 0; k < 2; ++k)
      out.half[h][k] = regressor.run(colours.half[h], features.half[1 - h], weights, k == 1);
  }
  return out;
}

// The share of k = 1 in every pixel and channel.
Rgb<float> selectionOf(const Colours& colours, const Rgb<float>& variance, const Candidates& candidates) {
  const auto error = [&](size_t k, size_t c, size_t i) {
    const float a = candidates.half[0][k][c][i], b = candidates.half[1][k][c][i];
    return 0.5f * (sqr(colours.half[1][c][i] - a) + sqr(colours.half[0][c][i] - b)) - 0.25f * sqr(a - b);
  };
  const std::array<NlmGuide, 3> guides = guidesOf(colours.mean, variance, 1, kMapPatch);
  const Rgb<float> difference = filteredByChannel(
      guides, kMapWindow,
      imageOf(colours.width(), colours.height(), [&](size_t c, size_t i) { return error(1, c, i) - error(0, c, i); }));
  return filteredByChannel(guides, kMapWindow, imageOf(colours.width(), colours.height(), [&](size_t c, size_t i) {
                             return difference[c][i] > 0 ? 1.0f : 0.0f;
                           }));
}

void multiply(Rgb<float>& image, const Rgb<float>& by) {
  image = imageOf(image.width(), image.height(), [&](size_t c, size_t i) { return image[c][i] * by[c][i]; });
}

}  // namespace

NforResult nforFilter(const Estimate& estimate, const Features* features, const NforOptions& options) {
  BRAID_ASSERT(!estimate.mean.empty() && !estimate.half[0].empty() && !estimate.half[1].empty() && options.stride >= 1);
  const int width = estimate.mean.width(), height = estimate.mean.height();
  const FeatureHalves crossed = crossPrefiltered(features);
  const FeatureChannels meanFeatures = prefilteredMean(crossed);
  const Plane<float>* albedo = options.demodulate ? meanFeatures.albedo() : nullptr;
  const Colours colours = options.removeFireflies
                              ? coloursOf(withoutFireflies(estimate, options.quarters, features), albedo)
                              : coloursOf(estimate, albedo);
  const Rgb<float> variance = guideVariance(colours, passesOf(estimate), options.variance);
  Regressor regressor(colours.mean, variance, options);
  NforResult result;
  {
    const Candidates candidates = crossedCandidates(colours, variance, crossed, regressor);
    result.selection = selectionOf(colours, variance, candidates);
    for (size_t h = 0; h < 2; ++h)
      result.half[h] = imageOf(width, height, [&](size_t c, size_t i) {
        const float share = result.selection[c][i];
        return share * candidates.half[h][0][c][i] + (1 - share) * candidates.half[h][1][c][i];
      });
  }
  const Rgb<float> mean = average(result.half[0], result.half[1]);
  const Rgb<float> left = imageOf(
      width, height, [&](size_t c, size_t i) { return 0.25f * sqr(result.half[0][c][i] - result.half[1][c][i]); });
  result.mean = regressor.run(mean, meanFeatures, regressor.weights(mean, left, mean, false), false);
  if (!colours.divisor.empty())
    for (Rgb<float>* image : {&result.mean, &result.half[0], &result.half[1]}) multiply(*image, colours.divisor);
  result.report = regressor.report;
  return result;
}

}  // namespace braid
