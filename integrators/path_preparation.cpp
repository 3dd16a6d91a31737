// SPDX-License-Identifier: Apache-2.0
#include "integrators/path_preparation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "integrators/guiding/pixel_grid.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x6c69676874;
// Frames with fewer pixels cost less to render than to measure.
constexpr uint64_t kFewestPixels = 32768;
// A place for so many pixels of the frame, up to a number: the trial costs less than a pass.
constexpr uint64_t kPixelsOfPlace = 192, kMostPlaces = 2048;
// As many passes of each bucket as make low-discrepancy points worth their name: what they do for light samples, more
// light samples need not do.
constexpr uint64_t kPasses = 16 * kSequenceBuckets;
constexpr int kTried = 4;  // light samples of the paths that are held against those with one
constexpr double kPays = 1.2;
// Of a light sample with its shadow ray, in rays of paths with their shading.
constexpr double kLightSampleCost = 1.2;
// What counts as the brightness of a black place: this share of the mean.
constexpr double kDarkest = 0.1;
// Means above this many times their place's brightness count as that.
constexpr double kMostRelative = 8;

// Paths over a grid, with the render's points.
class Trial {
 public:
  Trial(const TransportContext& context, const Plan& plan)
      : context_(context), plan_(plan), grid_(plan.settings, places(plan.settings)) {
    for (uint64_t k = 0; k < kPasses; ++k)
      samplers_.emplace_back(plan.settings.sampler, plan.settings.seed, kStream, k);
  }

  LightSampleShares run() const {
    const Outcome one = trace(1), more = trace(kTried);
    const std::vector<double> scale = inverseBrightness(one.mean, more.mean);
    const double variance = relativeVariance(one.mean, scale);
    if (!(variance > 0) || !(one.cost > 0)) return {};
    // Variances are a + b / n, costs c + d n. Only direct light differs: the rest of the paths is the same, noise that
    // would hide what is looked for.
    constexpr double kLess = 1 - 1.0 / kTried;
    const double less = relativeVariance(one.direct, scale) - relativeVariance(more.direct, scale);
    return {std::clamp(less / variance / kLess, 0.0, 1.0),
            std::clamp((more.cost / one.cost - 1) / (kTried - 1), 0.0, 1.0)};
  }
  size_t paths() const { return 2 * kPasses * grid_.size(); }

 private:
  using Buckets = std::vector<std::array<float, kSequenceBuckets>>;  // means by place
  struct Outcome {
    Buckets mean, direct;
    double cost = 0;
  };

  static uint64_t places(const Settings& s) {
    const uint64_t pixels = static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height);
    return std::min(pixels / kPixelsOfPlace, kMostPlaces);
  }

  Outcome trace(int lightSamples) const {
    Outcome outcome;
    outcome.mean.assign(grid_.size(), {});
    outcome.direct = outcome.mean;
    std::vector<double> costs((grid_.size() + kBatch - 1) / kBatch, 0.0);
    parallelChunks(grid_.size(), kBatch, [&](size_t begin, size_t end) {
      for (uint64_t pass = 0; pass < kPasses; ++pass) {
        const PassSampler& sampler = samplers_[pass];
        const auto kernel = std::make_unique<PathKernel>(context_, plan_, sampler, nullptr);
        kernel->use({.lightSamples = lightSamples});
        for (size_t i = begin; i < end; ++i)
          kernel->start(grid_.x(i), grid_.y(i), sampler.itemKey(pixelItem(plan_, grid_.x(i), grid_.y(i))));
        kernel->run();
        for (size_t i = begin; i < end; ++i) {
          const PathSample& sample = kernel->sample(static_cast<int>(i - begin));
          if (!isFinite(sample.radiance)) continue;
          outcome.mean[i][pass % kSequenceBuckets] += average(sample.radiance) * kSequenceBuckets / kPasses;
          outcome.direct[i][pass % kSequenceBuckets] += average(sample.direct) * kSequenceBuckets / kPasses;
        }
        costs[begin / kBatch] +=
            static_cast<double>(kernel->rayCount) + kLightSampleCost * static_cast<double>(kernel->shadowRayCount);
      }
    });
    for (const double c : costs) outcome.cost += c;
    return outcome;
  }

  // 1 / the brightness of a place, as far as it is known, and never below a tenth of the mean of all.
  std::vector<double> inverseBrightness(const Buckets& a, const Buckets& b) const {
    std::vector<double> scale(grid_.size());
    double whole = 0;
    for (size_t i = 0; i < scale.size(); ++i) {
      for (size_t k = 0; k < kSequenceBuckets; ++k) scale[i] += static_cast<double>(a[i][k] + b[i][k]);
      scale[i] /= 2 * kSequenceBuckets;
      whole += scale[i] / static_cast<double>(scale.size());
    }
    for (double& s : scale) s = whole > 0 ? 1 / (s + kDarkest * whole) : 0;
    return scale;
  }

  double relativeVariance(const Buckets& buckets, const std::vector<double>& scale) const {
    double total = 0;
    for (size_t i = 0; i < grid_.size(); ++i) {
      double sum = 0, squares = 0;
      for (const float mean : buckets[i]) {
        const double v = std::min(static_cast<double>(mean) * scale[i], kMostRelative);
        sum += v;
        squares += v * v;
      }
      total += squares - sum * sum / kSequenceBuckets;
    }
    return total;
  }

  const TransportContext& context_;
  const Plan& plan_;
  const PixelGrid grid_;
  std::vector<PassSampler> samplers_;
};

}  // namespace

double lightSampleGain(const LightSampleShares& shares, int count) {
  const auto n = static_cast<double>(count);
  return 1 / ((1 - shares.variance + shares.variance / n) * (1 + shares.cost * (n - 1)));
}

int lightSamplesThatPay(const LightSampleShares& shares) {
  int best = 1;
  for (int n = 2; n <= kTried; ++n)
    if (lightSampleGain(shares, n) > lightSampleGain(shares, best)) best = n;
  return lightSampleGain(shares, best) >= kPays ? best : 1;
}

Applies lightSamplesMeasured(const Plan& plan) {
  const Settings& s = plan.settings;
  if (s.lightSamples > 0) return {false, fmt::format("{}, on request", s.lightSamples)};
  if (s.maxDepth < 2) return {false, "paths scatter nowhere"};
  if (static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height) < kFewestPixels)
    return {false, fmt::format("one, for the frame has fewer than {} pixels: to measure would cost more than them",
                               kFewestPixels)};
  return {true, "measured before the first pass, and more than one where that pays"};
}

PathPreparation::PathPreparation(const TransportContext& context, const Plan& plan) {
  if (guidingApplies(plan).yes) {
    guide_.emplace(context, plan);
    decisions_ = guide_->decisions();
  }
  if (plan.settings.lightSamples > 0) lightSamples_ = plan.settings.lightSamples;
  if (lightSamplesMeasured(plan).yes) measureLightSamples(context, plan);
}

void PathPreparation::measureLightSamples(const TransportContext& context, const Plan& plan) {
  const Trial trial(context, plan);
  const LightSampleShares shares = trial.run();
  lightSamples_ = lightSamplesThatPay(shares);
  const std::string found = fmt::format("they are {:.0f} % of the variance and {:.0f} % of the cost of {} paths",
                                        100 * shares.variance, 100 * shares.cost, trial.paths());
  if (lightSamples_ > 1)
    decisions_.push_back({true, "light samples",
                          fmt::format("{} at the first surface, variance x cost is {:.2f} times less: {}",
                                      lightSamples_, lightSampleGain(shares, lightSamples_), found)});
  else
    decisions_.push_back({false, "light samples", "more than one at the first surface would not pay: " + found});
}

}  // namespace braid
