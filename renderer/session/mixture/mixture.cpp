// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/mixture/mixture.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

// What combining leaves of the variance of independent pixels: alone, beside a photon map, which keeps some filters
// out, and of fireflies; and of the variance of photon maps, whose neighbours share their photons
// (combiners/EXPERIMENTS.md, Integrators by a pilot).
constexpr double kNoiseLeft = 0.04, kNoiseLeftBeside = 0.1, kFirefliesLeft = 0.1, kMapNoiseLeft = 0.4;
// A firefly that is removed takes this much of a block with it at most.
constexpr double kMostFireflies = 0.03;
// The fusion of combiners counts squared biases twice (combiners/shrinkage/fused_estimate.h).
constexpr double kBiasCounts = 2;
// Variance and squared bias of photon maps fall with their passes to this power.
constexpr double kPhotonPower = -2.0 / 3;
// Light that a photon map has and the unbiased image lacks by more standard deviations has not been met by its paths.
constexpr double kMissedDeviations = 2.5;
constexpr double kBlockPixels = 16;
// Of light that a pilot's paths need not meet, what still harms beside a photon map that has it: rare finds do not show
// in the variances that weigh both.
constexpr double kHiddenBeside = 0.08;
// Blocks are left out by turns for the standard error.
constexpr size_t kGroups = 8;

double costOf(const Mixture& m, const std::vector<PilotMeasure>& measures) {
  return measures[m.unbiased].cost + (m.photons == Mixture::kNone ? 0 : measures[m.photons].cost);
}

double varianceOf(const PilotBlock& b) { return static_cast<double>(b.noise) + static_cast<double>(b.fireflies); }
double biasOf(const PilotBlock& b) { return std::max(0.0, static_cast<double>(b.bias)); }

double logRatio(double error, double other) { return error > 0 && other > 0 ? std::log(error / other) : 0; }

// Squared error, at most the brightness, by light that paths have not met in so many passes: its variance does not
// show.
double missedLight(const PilotBlock& u, const PilotBlock& map, double passes) {
  const double lacks = static_cast<double>(map.mean) - static_cast<double>(u.mean);
  const double variance = varianceOf(map) / passes + varianceOf(u) / (passes * kBlockPixels) + biasOf(map);
  return lacks > kMissedDeviations * std::sqrt(variance) ? std::min(lacks * lacks, 1.0) : 0;
}

double firefliesLeft(double variance) { return std::min(kFirefliesLeft * variance, kMostFireflies); }

// What combining leaves of an unbiased image of n passes with light that it misses.
double errorAlone(const PilotBlock& u, double missed, double n) {
  return kNoiseLeft * static_cast<double>(u.noise) / n + firefliesLeft(static_cast<double>(u.fireflies) / n) + missed;
}

// The same beside a photon map of as many passes.
double errorBeside(const PilotBlock& u, double missed, const PilotBlock& map, double n, double pilotPasses) {
  const double shrinks = std::pow(n / pilotPasses, kPhotonPower);
  const double noise = static_cast<double>(map.noise) / pilotPasses * shrinks,
               fireflies = static_cast<double>(map.fireflies) / pilotPasses * shrinks, bias = biasOf(map) * shrinks;
  const double unbiasedError = varianceOf(u) / n + missed, mapError = noise + fireflies + kBiasCounts * bias;
  if (!(unbiasedError + mapError > 0)) return 0;
  const double w = mapError / (unbiasedError + mapError);
  const double left = kNoiseLeftBeside * static_cast<double>(u.noise) / n +
                      firefliesLeft(static_cast<double>(u.fireflies) / n) + missed;
  return w * w * left + (1 - w) * (1 - w) * (kMapNoiseLeft * noise + firefliesLeft(fireflies) + bias);
}

}  // namespace

double expectedError(const Mixture& mixture, const std::vector<PilotMeasure>& measures, double cost, size_t group,
                     size_t groups) {
  const double n = cost / costOf(mixture, measures);
  const PilotMeasure& u = measures[mixture.unbiased];
  const auto map = std::find_if(measures.begin(), measures.end(), [](const PilotMeasure& m) { return !m.unbiased; });
  double sum = 0, count = 0;
  for (size_t b = 0; b < u.blocks.size(); ++b) {
    if (groups > 0 && b % groups == group) continue;
    const double missed = map == measures.end() ? 0 : missedLight(u.blocks[b], map->blocks[b], u.passes);
    sum += mixture.photons == Mixture::kNone
               ? errorAlone(u.blocks[b], missed, n)
               : errorBeside(u.blocks[b], missed, measures[mixture.photons].blocks[b], n, u.passes);
    ++count;
  }
  return (count > 0 ? sum / count : 0) + (mixture.photons == Mixture::kNone ? 1 : kHiddenBeside) * u.hidden;
}

size_t bestOf(const std::vector<Mixture>& mixtures, size_t present, const std::vector<double>& error,
              const std::vector<double>& uncertainty) {
  const auto pays = [&](size_t m) {
    return logRatio(error[present], error[m]) > std::max(std::log(kMixturePays), uncertainty[m]);
  };
  size_t best = present;
  for (size_t m = 0; m < mixtures.size(); ++m)
    if (pays(m) && error[m] < error[best]) best = m;
  size_t chosen = best;
  for (size_t m = 0; m < mixtures.size() && mixtures[best].photons != Mixture::kNone; ++m) {
    const bool asGood = logRatio(error[m], error[best]) < std::max(uncertainty[m], uncertainty[best]);
    const bool better = chosen == best || error[m] < error[chosen];
    if (mixtures[m].photons == Mixture::kNone && pays(m) && asGood && better) chosen = m;
  }
  return chosen;
}

MixtureChoice chooseMixture(const std::vector<Mixture>& mixtures, size_t present,
                            const std::vector<PilotMeasure>& measures, double samples) {
  const double cost = samples * costOf(mixtures[present], measures);
  MixtureChoice choice;
  for (const Mixture& m : mixtures) choice.error.push_back(expectedError(m, measures, cost));
  for (size_t m = 0; m < mixtures.size(); ++m) {
    double sum = 0, squares = 0;
    for (size_t g = 0; g < kGroups; ++g) {
      const double r = logRatio(expectedError(mixtures[m], measures, cost, g, kGroups),
                                expectedError(mixtures[present], measures, cost, g, kGroups));
      sum += r;
      squares += r * r;
    }
    constexpr double k = kGroups;
    choice.uncertainty.push_back(std::sqrt(std::max(0.0, (squares - sum * sum / k) * (k - 1) / k)));
  }
  choice.best = bestOf(mixtures, present, choice.error, choice.uncertainty);
  return choice;
}

}  // namespace braid
