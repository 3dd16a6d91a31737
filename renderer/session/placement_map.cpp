// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/placement_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "renderer/core/box_sum.h"
#include "renderer/core/hash.h"

namespace braid {

namespace {

constexpr double kLeast = 0.125;    // samples of a tile, of those of the mean
constexpr int kMostDoublings = 4;   // of a tile from one map to the next
constexpr double kFaintest = 1e-6;  // of the mean error: what a tile without any is taken to have
constexpr double kPathCost = 0.3;   // of a path besides its hits, in hits
constexpr double kWorthIt = 1.03;   // from this predicted gain on
constexpr double kFloor = 0.3;      // of the squared typical brightness: 0.01 where middle grey is 0.18
constexpr double kDarkest = 1e-8;   // of the brightest tile
constexpr int kLevelRadius = 4;

double channelMean(const Rgb<float>& image, size_t i) {
  return (static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i])) / 3;
}

// Of the values of the pixels of each tile, those that are not finite left out.
template <class Value>
Plane<double> tileMeans(const SamplePlacement& p, const Value& value) {
  Plane<double> out(p.columns(), p.count[0].height);
  parallelFor(out.size(), [&](size_t t) {
    const int x0 = static_cast<int>(t) % p.columns() * p.kTile, y0 = static_cast<int>(t) / p.columns() * p.kTile;
    double sum = 0;
    for (int y = y0; y < std::min(y0 + p.kTile, p.height); ++y)
      for (int x = x0; x < std::min(x0 + p.kTile, p.width); ++x) {
        const double v = value(static_cast<size_t>(y) * static_cast<size_t>(p.width) + static_cast<size_t>(x));
        if (std::isfinite(v)) sum += v;
      }
    out[t] = sum / p.pixels(t);
  });
  return out;
}

// With the weights 1 2 1 along both sides, of the tiles that there are.
Plane<double> smoothed(const Plane<double>& in) {
  Plane<double> out(in.width, in.height);
  for (int y = 0; y < in.height; ++y)
    for (int x = 0; x < in.width; ++x) {
      double sum = 0, weights = 0;
      for (int v = std::max(0, y - 1); v <= std::min(in.height - 1, y + 1); ++v)
        for (int u = std::max(0, x - 1); u <= std::min(in.width - 1, x + 1); ++u) {
          const double w = (u == x ? 2 : 1) * (v == y ? 2 : 1);
          sum += w * in.at(u, v);
          weights += w;
        }
      out.at(x, y) = sum / weights;
    }
  return out;
}

// What is known of the tiles by one half, for placing the other.
struct Verdict {
  Plane<double> error;  // relative squared, of one sample a pixel
  Plane<double> cost;   // of a sample, in hits of surfaces
};

Verdict verdictOf(const FilmState& film, int judge, const RelativeErrors& errors) {
  const SamplePlacement& p = *film.placement;
  const Plane<float> relative = errors(estimatesOfHalf(film, judge, film.features.has_value()));
  Verdict v{smoothed(tileMeans(p, [&](size_t i) { return static_cast<double>(relative[i]); })),
            p.hits[static_cast<size_t>(judge)]};
  for (size_t t = 0; t < p.tiles(); ++t) {
    const double samples = p.ofHalf(t, judge);
    v.error[t] = std::max(0.0, v.error[t]) * samples;
    v.cost[t] = samples > 0 ? kPathCost + v.cost[t] / (samples * p.pixels(t)) : 1.0;
  }
  v.cost = smoothed(v.cost);
  return v;
}

// Σ over pixels of f(tile).
template <class F>
double overPixels(const SamplePlacement& p, const F& f) {
  double sum = 0;
  for (size_t t = 0; t < p.tiles(); ++t) sum += p.pixels(t) * f(t);
  return sum;
}

// How often the samples of tiles are doubled until the next map. Doublings keep the numbers of points of a bucket
// powers of two, of which low-discrepancy sequences make the most.
class Doublings {
 public:
  Doublings(const SamplePlacement& p, int half, const Verdict& v, double passes)
      : p_(p), half_(half), v_(v), passes_(passes), times_(p.tiles(), 1) {
    const double pixels = overPixels(p, [](size_t) { return 1.0; });
    least_ = kFaintest * overPixels(p, [&](size_t t) { return v.error[t]; }) / pixels;
    if (least_ > 0) spend(passes * pixels);
  }

  // Samples a pixel that the tile has then.
  double then(size_t t) const { return std::ldexp(p_.ofHalf(t, half_), times_[t]); }
  int times(size_t t) const { return times_[t]; }

 private:
  // What the doubling after so many takes off the relative error, for what it costs.
  double worth(size_t t, int times) const {
    const double n = std::ldexp(p_.ofHalf(t, half_), times);
    return n > 0 ? std::max(v_.error[t], least_) / (2 * n * n * v_.cost[t]) : 0.0;
  }
  double priceOf(size_t t) const { return p_.pixels(t) * std::ldexp(p_.ofHalf(t, half_), times_[t]); }
  // All doublings worth `limit`, and those that keep the tile from starving. The samples that they take.
  double choose(double limit) {
    for (size_t t = 0; t < p_.tiles(); ++t) {
      int& k = times_[t] = 0;
      while (k < kMostDoublings && (worth(t, k) >= limit || then(t) < kLeast * 2 * passes_)) ++k;
    }
    return overPixels(p_, [&](size_t t) { return then(t) - p_.ofHalf(t, half_); });
  }
  // The most worthwhile ones that `samples` pay for.
  void spend(double samples) {
    double dear = -300, cheap = 300;  // exponents of limits
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (dear + cheap);
      (choose(std::exp2(middle)) <= samples ? cheap : dear) = middle;
    }
    double left = samples - choose(std::exp2(cheap));
    std::vector<size_t> order(p_.tiles());
    std::iota(order.begin(), order.end(), size_t(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return worth(a, times_[a]) > worth(b, times_[b]); });
    for (const size_t t : order)
      if (times_[t] < kMostDoublings && priceOf(t) <= left) {
        left -= priceOf(t);
        ++times_[t];
      }
  }

  const SamplePlacement& p_;
  const int half_;
  const Verdict& v_;
  const double passes_;  // of the half until the next map
  double least_ = 0;
  std::vector<int> times_;
};

}  // namespace

bool mapIsDue(uint64_t round) { return round >= kPilotRounds && std::has_single_bit(round); }

Plane<float> varianceOverBrightness(const Estimates& half) {
  const Estimate& e = half.estimates.front();
  const SamplePlacement tiles(e.mean.width(), e.mean.height());
  const Plane<double> levels = tileMeans(tiles, [&](size_t i) { return channelMean(e.mean, i); });
  const double brightest = levels.empty() ? 0 : *std::max_element(levels.data.begin(), levels.data.end());
  double sum = 0, count = 0;
  for (const double l : levels.data)
    if (l > kDarkest * brightest && l > 0) {
      sum += std::log2(l);
      ++count;
    }
  const double typical = count > 0 ? std::exp2(sum / count) : 1.0, floor = kFloor * typical * typical;
  Plane<double> level(e.mean.width(), e.mean.height(), kUnfilled);
  for (size_t i = 0; i < level.size(); ++i) level[i] = std::max(0.0, channelMean(e.mean, i));
  const Plane<double> near = boxSum(level, kLevelRadius),
                      pixels = boxSum(Plane<double>(level.width, level.height, 1.0), kLevelRadius);
  Plane<float> out(level.width, level.height, kUnfilled);
  for (size_t i = 0; i < out.size(); ++i) {
    const double l = near[i] / pixels[i], relative = channelMean(e.variance, i) / (l * l + floor);
    out[i] = std::isfinite(relative) ? static_cast<float>(std::min(relative, 1e30)) : 0.0f;
  }
  return out;
}

double makePlacementMap(FilmState& film, uint64_t round, const RelativeErrors& errors) {
  SamplePlacement& p = *film.placement;
  const double passes = static_cast<double>(round) / 2;  // of a half until the next map
  double gain = 0;
  std::array<Plane<double>, 2> weight;
  for (int half = 0; half < 2; ++half) {
    const Verdict v = verdictOf(film, 1 - half, errors);
    const Doublings doublings(p, half, v, passes);
    const double even = overPixels(p, [&](size_t t) { return v.error[t] / (2 * p.ofHalf(t, half)); });
    const double placed = overPixels(p, [&](size_t t) { return v.error[t] / doublings.then(t); });
    const double gainOfHalf = placed > 0 ? even / placed : 1.0;
    gain += gainOfHalf / 2;
    const auto h = static_cast<size_t>(half);
    weight[h] = Plane<double>(p.columns(), p.count[0].height);
    for (size_t t = 0; t < p.tiles(); ++t) {
      const int times = gainOfHalf >= kWorthIt ? doublings.times(t) : 1;
      weight[h][t] = 2 * p.count[h][t] * (std::exp2(times) - 1) / passes;
    }
  }
  p.weight = std::move(weight);
  return std::max(1.0, gain);
}

std::vector<int> samplesOfPass(const SamplePlacement& p, uint64_t pass) {
  const uint64_t map = std::bit_floor(pass);
  std::vector<int> samples(p.tiles(), 1);
  if (map < kPilotRounds) return samples;
  // Each bucket has a sequence of its own and gets its share by itself: its passes since the map are 0, 1, 2, ...
  const auto index = static_cast<double>((pass - map) / 4);
  for (size_t t = 0; t < p.tiles(); ++t) {
    const double offset = static_cast<double>(hashCombine(map, t) >> 11) * 0x1p-53, w = p.weight[pass % 2][t];
    samples[t] = static_cast<int>(std::floor((index + 1) * w + offset) - std::floor(index * w + offset));
  }
  return samples;
}

}  // namespace braid
