// SPDX-License-Identifier: Apache-2.0
// Statistics for integrators whose pixels are not independent of each other. With the independent sampler passes are,
// so standard errors come from the spread of passes or of seeds, never from sums over pixels.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "tests/support/render_fixture.h"

namespace braid::test {

inline Settings settingsOf(const char* integrator, int width, int height, uint64_t spp, uint64_t seed = 0,
                           SamplerKind sampler = SamplerKind::Independent) {
  Settings s = settingsFor(width, height, spp, sampler);
  s.integrators = {integrator};
  s.seed = seed;
  return s;
}

// Means over square blocks of pixels, per channel, over settings.spp independent passes.
inline std::vector<Measured> passMeans(const Scene& scene, const Settings& settings, int block) {
  const Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene, settings.lightStrategy);
  const Integrator& integrator = *plan.integrators.at(0).integrator;
  const auto preparation = integrator.prepare(context, plan);
  PassTarget target(settings.width, settings.height, {.splats = integrator.splats(), .features = plan.kept.features});
  std::vector<double> sum, squares;
  for (uint64_t pass = 0; pass < settings.spp; ++pass) {
    target.clear();
    REQUIRE(integrator.renderPass({context, plan, pass, nullptr, nullptr, nullptr, preparation.get()}, target));
    CHECK(target.rejected() == 0);
    Accumulator film(settings.width, settings.height, 2);
    film.commit(0, target);
    const Rgb<float> image = film.mean();
    size_t k = 0;
    for (int y = 0; y < settings.height; y += block)
      for (int x = 0; x < settings.width; x += block)
        for (size_t c = 0; c < 3; ++c, ++k) {
          double total = 0, count = 0;
          for (int v = y; v < std::min(y + block, settings.height); ++v)
            for (int u = x; u < std::min(x + block, settings.width); ++u, ++count)
              total += static_cast<double>(image[c].at(u, v));
          sum.resize(std::max(sum.size(), k + 1));
          squares.resize(sum.size());
          sum[k] += total / count;
          squares[k] += sqr(total / count);
        }
  }
  std::vector<Measured> result;
  const auto n = static_cast<double>(settings.spp);
  for (size_t k = 0; k < sum.size(); ++k)
    result.push_back({sum[k] / n, std::sqrt(std::max(0.0, squares[k] / n - sqr(sum[k] / n)) / (n - 1))});
  return result;
}

// The largest z over all blocks and channels, divided by its limit at a false-alarm rate of 10⁻⁴.
inline double disagreement(const std::vector<Measured>& a, const std::vector<Measured>& b) {
  REQUIRE(a.size() == b.size());
  double worst = 0;
  for (size_t i = 0; i < a.size(); ++i) worst = std::max(worst, zScore(a[i], b[i]));
  return worst / zLimit(a.size());
}

// Σ reported variance / Σ empirical variance over pixels, channels and seeds 0, 1, …; its standard error by
// linearisation over the seeds, as in test_calibration.cpp.
inline Measured reportedOverEmpirical(const Scene& scene, const Settings& settings, uint64_t seeds) {
  Plan plan = makePlan(scene, scene.data().cameras.at(0), settings, integrators());
  const TransportContext context(scene, settings.lightStrategy);
  const Integrator& integrator = *plan.integrators.at(0).integrator;
  const auto preparation = integrator.prepare(context, plan);
  PassTarget target(settings.width, settings.height, {.splats = integrator.splats(), .features = plan.kept.features});
  std::vector<Rgb<float>> means, variances;
  for (plan.settings.seed = 0; plan.settings.seed < seeds; ++plan.settings.seed) {
    Accumulator film(settings.width, settings.height, plan.buckets());
    for (uint64_t pass = 0; pass < settings.spp; ++pass) {
      target.clear();
      integrator.renderPass({context, plan, pass, nullptr, nullptr, nullptr, preparation.get()}, target);
      film.commit(pass, target);
    }
    means.push_back(film.mean());
    variances.push_back(film.variance(integrator.lowDiscrepancy(settings)));
  }
  const auto n = static_cast<double>(seeds);
  std::vector<double> reported(seeds, 0.0), distance(seeds, 0.0);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < means[0].size(); ++i) {
      double mean = 0;
      for (const Rgb<float>& m : means) mean += static_cast<double>(m[c][i]) / n;
      for (size_t s = 0; s < seeds; ++s) {
        reported[s] += static_cast<double>(variances[s][c][i]);
        distance[s] += sqr(static_cast<double>(means[s][c][i]) - mean) * n / (n - 1);
      }
    }
  double sumReported = 0, sumDistance = 0, residual = 0;
  for (size_t s = 0; s < seeds; ++s) {
    sumReported += reported[s];
    sumDistance += distance[s];
  }
  const double ratio = sumReported / sumDistance;
  for (size_t s = 0; s < seeds; ++s) residual += sqr(reported[s] - ratio * distance[s]);
  return {ratio, std::sqrt(residual) / sumDistance};
}

// A ratio counts only with a standard error below 0.027: then a true ratio of 1 leaves [0.9, 1.1] with a probability
// below 2.2e-4.
inline void checkCalibrated(const std::string& name, const Measured& ratio) {
  MESSAGE(name, ": reported over empirical variance ", ratio.value, " +- ", ratio.error);
  CHECK(ratio.error < 0.027);
  CHECK(ratio.value > 0.9);
  CHECK(ratio.value < 1.1);
}

}  // namespace braid::test
