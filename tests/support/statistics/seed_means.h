// SPDX-License-Identifier: Apache-2.0
// Agreement of integrators by renders of different seeds: right also where pixels share random numbers, photons or a
// reconstruction.
#pragma once

#include <vector>

#include "tests/support/render_fixture.h"

namespace braid::test {

struct SeedMeans {
  int side = 0;                     // of the square frame, pixels
  int block = 0;                    // of the blocks that means are taken over
  uint64_t seeds = 0;               // renders
  std::vector<size_t> channels{1};  // green alone
};

// Means over blocks and channels, with their standard errors.
inline std::vector<Measured> blockMeans(const SeedMeans& how, const Scene& scene, const char* integrator, uint64_t spp,
                                        uint64_t firstSeed) {
  Settings settings = settingsFor(how.side, how.side, spp);
  settings.integrators = {integrator};
  settings.photonRadius = 1;
  std::vector<double> sum, squares;
  const auto seeds = static_cast<double>(how.seeds);
  for (uint64_t k = 0; k < how.seeds; ++k) {
    settings.seed = firstSeed + k;
    const RenderResult r = render(scene, settings);
    size_t i = 0;
    for (const PixelWindow& block : blocksOf(r, how.block))
      for (const size_t c : how.channels) {
        sum.resize(std::max(sum.size(), i + 1));
        squares.resize(sum.size());
        const double mean = meanOver(r, c, block).value;
        sum[i] += mean / seeds;
        squares[i++] += sqr(mean) / seeds;
      }
  }
  std::vector<Measured> means;
  for (size_t i = 0; i < sum.size(); ++i)
    means.push_back({sum[i], std::sqrt(std::max(0.0, squares[i] - sqr(sum[i])) / (seeds - 1))});
  return means;
}

// The largest difference in standard errors, `bias` of the value forgiven.
inline double worst(const std::vector<Measured>& a, const std::vector<Measured>& b, double bias) {
  double z = 0;
  for (size_t i = 0; i < a.size(); ++i)
    z = std::max(z, (std::fabs(a[i].value - b[i].value) - bias * b[i].value) / std::hypot(a[i].error, b[i].error));
  return z;
}

}  // namespace braid::test
