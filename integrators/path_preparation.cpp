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
constexpr int kTried = 4;  // light samples, or directions, of the paths that are held against those with one
constexpr double kPays = 1.15, kSplitsPay = 1.05;
// A gain of light samples between these is measured again at as many other places: chance might decide.
constexpr double kHardlyPays = 1.03, kSurelyPays = 1.5;
// Where light that comes straight from lamps is more than this share of the variance, directions have little to gain.
constexpr double kMostDirectShare = 0.6;
// Of a light sample with its shadow ray, in rays of paths with their shading.
constexpr double kLightSampleCost = 1.2;
// Parts of the places, which are left out in turn.
constexpr size_t kParts = 16;
// What counts as the brightness of a black place: this share of the mean.
constexpr double kDarkest = 0.1;
// Means above this many times their place's brightness count as that.
constexpr double kMostRelative = 8;

// The number of samples with the least variance x cost.
int bestCount(const SampleShares& shares) {
  int best = 1;
  for (int n = 2; n <= kTried; ++n)
    if (sampleGain(shares, n) > sampleGain(shares, best)) best = n;
  return best;
}

}  // namespace

// Paths over a grid, with the render's points.
class PathPreparation::Trial {
 public:
  Trial(const TransportContext& context, const Plan& plan) : context_(context), plan_(plan), grid_(gridOf(plan)) {
    const Settings& s = plan.settings;
    const auto sampler = [&](uint64_t pass) { return PassSampler(s.sampler, s.seed, kStream, pass); };
    for (uint64_t k = 0; k < kPasses; ++k) {
      samplers_.push_back(sampler(k));
      if (s.sampler == SamplerKind::Sobol && pathSplitsMeasured(plan).yes)
        for (uint64_t b = 0; b < kTried; ++b) branches_.push_back(sampler(branchPass(k, b, kTried)));
    }
    one_ = trace(grid_, 1, 1);
  }

  struct LightSamples {
    SampleShares shares;
    size_t paths = 0;
  };
  // Variances are a + b / n, costs c + d n. With more light samples only direct light differs: the rest of the paths is
  // the same, noise that would hide what is looked for.
  LightSamples lightSamples() const {
    Totals totals = lightSampleTotals(grid_, one_);
    LightSamples found{shares(totals), paths()};
    const double gain = sampleGain(found.shares, bestCount(found.shares));
    if (gain < kHardlyPays || gain > kSurelyPays) return found;
    const PixelGrid others = gridOf(plan_, true);
    totals += lightSampleTotals(others, trace(others, 1, 1));
    return {shares(totals), found.paths + 2 * kPasses * others.size()};
  }
  // Of paths with so many light samples: by all places, then with one part of them left out after the other.
  std::vector<SampleShares> directions(int lightSamples) const {
    const Outcome one = lightSamples == 1 ? one_ : trace(grid_, lightSamples, 1);
    const Outcome more = trace(grid_, lightSamples, kTried);
    const std::vector<double> scale = inverseBrightness(one.mean, more.mean);
    std::vector<SampleShares> found;
    for (size_t leftOut = 0; leftOut <= kParts; ++leftOut) {
      const size_t part = leftOut == 0 ? kParts : leftOut - 1;
      const double variance = relativeVariance(one.mean, scale, part);
      const double less = variance - relativeVariance(more.mean, scale, part);
      found.push_back(shares({variance, less, one.cost, more.cost}));
    }
    return found;
  }
  // Share of direct light in the variance of paths with one of each.
  double directShare() const {
    const std::vector<double> scale = inverseBrightness(one_.mean, one_.mean);
    const double variance = relativeVariance(one_.mean, scale);
    return variance > 0 ? relativeVariance(one_.direct, scale) / variance : 1;
  }
  // Of two outcomes.
  size_t paths() const { return 2 * kPasses * grid_.size(); }

 private:
  // With one sample or direction: variance, and how much less it is with kTried; costs of both.
  struct Totals {
    double variance = 0, less = 0, cost = 0, costOfMore = 0;
    void operator+=(const Totals& o) {
      variance += o.variance;
      less += o.less;
      cost += o.cost;
      costOfMore += o.costOfMore;
    }
  };
  static SampleShares shares(const Totals& t) {
    if (!(t.variance > 0) || !(t.cost > 0)) return {};
    constexpr double kLess = 1 - 1.0 / kTried;
    return {std::clamp(t.less / t.variance / kLess, 0.0, 1.0),
            std::clamp((t.costOfMore / t.cost - 1) / (kTried - 1), 0.0, 1.0)};
  }

  using Buckets = std::vector<std::array<float, kSequenceBuckets>>;  // means by place
  struct Outcome {
    Buckets mean, direct;
    double cost = 0;
  };

  static PixelGrid gridOf(const Plan& plan, bool between = false) {
    const uint64_t pixels = static_cast<uint64_t>(plan.settings.width) * static_cast<uint64_t>(plan.settings.height);
    return PixelGrid(plan.settings, std::min(pixels / kPixelsOfPlace, kMostPlaces), between);
  }

  Totals lightSampleTotals(const PixelGrid& grid, const Outcome& one) const {
    const Outcome more = trace(grid, kTried, 1);
    const std::vector<double> scale = inverseBrightness(one.mean, more.mean);
    return {relativeVariance(one.mean, scale),
            relativeVariance(one.direct, scale) - relativeVariance(more.direct, scale), one.cost, more.cost};
  }

  Outcome trace(const PixelGrid& grid, int lightSamples, int splits) const {
    Outcome outcome;
    outcome.mean.assign(grid.size(), {});
    outcome.direct = outcome.mean;
    std::vector<double> costs((grid.size() + kBatch - 1) / kBatch, 0.0);
    parallelChunks(grid.size(), kBatch, [&](size_t begin, size_t end) {
      for (uint64_t pass = 0; pass < kPasses; ++pass) {
        const PassSampler& sampler = samplers_[pass];
        const auto kernel = std::make_unique<PathKernel>(context_, plan_, sampler, nullptr);
        PathAids aids{.lightSamples = lightSamples, .splits = splits};
        if (splits > 1 && !branches_.empty()) aids.branches = {&branches_[pass * kTried], kTried};
        kernel->use(aids);
        for (size_t i = begin; i < end; ++i)
          kernel->start(grid.x(i), grid.y(i), sampler.itemKey(pixelItem(plan_, grid.x(i), grid.y(i))));
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
    std::vector<double> scale(a.size());
    double whole = 0;
    for (size_t i = 0; i < scale.size(); ++i) {
      for (size_t k = 0; k < kSequenceBuckets; ++k) scale[i] += static_cast<double>(a[i][k] + b[i][k]);
      scale[i] /= 2 * kSequenceBuckets;
      whole += scale[i] / static_cast<double>(scale.size());
    }
    for (double& s : scale) s = whole > 0 ? 1 / (s + kDarkest * whole) : 0;
    return scale;
  }

  double relativeVariance(const Buckets& buckets, const std::vector<double>& scale, size_t leftOut = kParts) const {
    double total = 0;
    for (size_t i = 0; i < buckets.size(); ++i) {
      if (i % kParts == leftOut) continue;
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
  std::vector<PassSampler> samplers_, branches_;
  Outcome one_;
};

double sampleGain(const SampleShares& shares, int count) {
  const auto n = static_cast<double>(count);
  return 1 / ((1 - shares.variance + shares.variance / n) * (1 + shares.cost * (n - 1)));
}

int lightSamplesThatPay(const SampleShares& shares) {
  const int best = bestCount(shares);
  return sampleGain(shares, best) >= kPays ? best : 1;
}

double sampleGainError(std::span<const SampleShares> without, int count) {
  double mean = 0, squares = 0;
  const auto n = static_cast<double>(without.size());
  for (const SampleShares& s : without) mean += sampleGain(s, count) / n;
  for (const SampleShares& s : without) squares += sqr(sampleGain(s, count) - mean);
  return without.empty() ? 0 : std::sqrt(squares * (n - 1) / n);
}

int pathSplitsThatPay(const SampleShares& shares, std::span<const SampleShares> without) {
  const int best = sampleGain(shares, kTried) > sampleGain(shares, 2) ? kTried : 2;
  return sampleGain(shares, best) - sampleGainError(without, best) >= kSplitsPay ? best : 1;
}

namespace {

Applies measured(const Settings& s, int asked) {
  if (asked > 0) return {false, fmt::format("{}, on request", asked)};
  if (s.maxDepth < 2) return {false, "paths scatter nowhere"};
  if (static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height) < kFewestPixels)
    return {false, fmt::format("one, for the frame has fewer than {} pixels: to measure would cost more than them",
                               kFewestPixels)};
  return {true, "measured before the first pass, and more than one where that pays"};
}

}  // namespace

Applies lightSamplesMeasured(const Plan& plan) { return measured(plan.settings, plan.settings.lightSamples); }
Applies pathSplitsMeasured(const Plan& plan) {
  if (plan.settings.pathSplits == 1)
    return {false, "one direction: a combined image loses more by fewer samples (--path-splits 0: as many as pay)"};
  return measured(plan.settings, plan.settings.pathSplits);
}

PathPreparation::PathPreparation(const TransportContext& context, const Plan& plan) {
  if (guidingApplies(plan).yes) {
    guide_.emplace(context, plan);
    decisions_ = guide_->decisions();
  }
  if (plan.settings.lightSamples > 0) lightSamples_ = plan.settings.lightSamples;
  if (plan.settings.pathSplits > 0) pathSplits_ = plan.settings.pathSplits;
  const bool lights = lightSamplesMeasured(plan).yes, directions = pathSplitsMeasured(plan).yes;
  if (!lights && !directions) return;
  const Trial trial(context, plan);
  if (lights) chooseLightSamples(trial);
  if (directions) choosePathSplits(trial);
}

void PathPreparation::chooseLightSamples(const Trial& trial) {
  const auto [shares, paths] = trial.lightSamples();
  lightSamples_ = lightSamplesThatPay(shares);
  const std::string found = fmt::format("they are {:.0f} % of the variance and {:.0f} % of the cost of {} paths",
                                        100 * shares.variance, 100 * shares.cost, paths);
  if (lightSamples_ > 1)
    decisions_.push_back({true, "light samples",
                          fmt::format("{} at the first surface, variance x cost is {:.2f} times less: {}",
                                      lightSamples_, sampleGain(shares, lightSamples_), found)});
  else
    decisions_.push_back({false, "light samples", "more than one at the first surface would not pay: " + found});
}

void PathPreparation::choosePathSplits(const Trial& trial) {
  const auto decide = [&](bool kept, std::string reason) {
    decisions_.push_back({kept, "path splits", std::move(reason)});
  };
  if (const double direct = trial.directShare(); direct > kMostDirectShare)
    return decide(false,
                  fmt::format("direct light is {:.0f} % of the variance of {} paths", 100 * direct, trial.paths() / 2));
  const std::vector<SampleShares> found = trial.directions(lightSamples_);
  const std::span<const SampleShares> without = std::span(found).subspan(1);
  pathSplits_ = pathSplitsThatPay(found[0], without);
  const int told = pathSplits_ > 1 ? pathSplits_ : 2;
  const std::string gain =
      fmt::format("{:.2f} ± {:.2f} times less: they are {:.0f} % of the variance and {:.0f} % of the cost of {} paths",
                  sampleGain(found[0], told), sampleGainError(without, told), 100 * found[0].variance,
                  100 * found[0].cost, trial.paths());
  if (pathSplits_ > 1)
    decide(true, fmt::format("{} directions from the first surface, variance x cost is {}", pathSplits_, gain));
  else
    decide(false, fmt::format("more than one direction from the first surface would not pay, variance x cost of two is "
                              "{}",
                              gain));
}

}  // namespace braid
