// SPDX-License-Identifier: Apache-2.0
// The weights of ensemble denoising: their filter, their blocks and the errors that they come from.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/ensemble/ensemble_weights.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/ensemble/weight_bilateral.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_ensemble_weights {

using namespace test;

namespace {

bool onSimplex(const WeightMaps& maps, size_t c) {
  for (size_t i = 0; i < maps.planes[0].size(); ++i) {
    double sum = 0;
    for (size_t b = 0; b < maps.bases; ++b) {
      if (maps.of(b, c)[i] < 0) return false;
      sum += static_cast<double>(maps.of(b, c)[i]);
    }
    if (std::fabs(sum - 1) > 2e-6) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("Filtered weights stay on the simplex, halves average to the mean, and maps are the weights") {
  const Case c = makeCase();
  const MethodInputs in = inputsOf(c);
  for (const bool shared : {false, true}) {
    const WeightMaps raw = ensembleWeights(*in.unbiased, in.bases, {.patchRadius = 3, .shared = shared});
    const WeightMaps maps = filteredWeights(raw, weightedEstimate(raw, in.bases), in.features);
    for (size_t ch = 0; ch < 3; ++ch) {
      CHECK(onSimplex(raw, ch));
      CHECK(onSimplex(maps, ch));
    }
    CHECK(maps.channels == (shared ? 1 : 3));
  }
  const MethodResult r = make_ensemble()->run(in);
  REQUIRE(r.aovs.size() == 3);
  CHECK(r.aovs[0].name == "weight.ensemble.narrow");
  const Estimate& e = r.image;
  for (size_t i = 0; i < e.mean.size(); ++i)
    CHECK(std::fabs(e.mean[0][i] - 0.5f * (e.half[0][0][i] + e.half[1][0][i])) < 1e-5f * (1 + e.mean[0][i]));
}

TEST_CASE("Blocks share the weights of their first pixel") {
  CaseOptions o;
  o.width = 150;  // more than a tile, and no multiple of 4
  o.height = 37;
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  for (const bool shared : {false, true}) {
    const WeightMaps all = ensembleWeights(*in.unbiased, in.bases, {.shared = shared});
    for (const int stride : {2, 4}) {
      const WeightMaps blocks = ensembleWeights(*in.unbiased, in.bases, {.stride = stride, .shared = shared});
      // Problems are solved together and stop together, so that another company ends a little nearer to the minimum.
      float worst = 0;
      for (size_t m = 0; m < all.planes.size(); ++m)
        for (int y = 0; y < o.height; ++y)
          for (int x = 0; x < o.width; ++x)
            worst = std::max(worst,
                             std::fabs(blocks.planes[m].at(x, y) - all.planes[m].at(x - x % stride, y - y % stride)));
      CHECK(worst < 1e-3f);
      CHECK(blocks.planes[0].at(stride, 0) != all.planes[0].at(stride + 1, 0));
    }
  }
}

TEST_CASE("Relative errors: the scale of a pixel, and no bright pixel decides for the dark ones around it") {
  Rgb<float> guide(5, 4, 0.5f), variance(5, 4, 0.2f);
  for (size_t ch = 0; ch < 3; ++ch) guide[ch].at(1, 0) = 2;
  const Plane<float> roots = relativeErrorRoots(guide, variance);
  CHECK(roots.at(4, 3) == doctest::Approx(1 / std::sqrt(0.25 + 0.01 + 0.3 * 0.2)));
  const double level = 0.5 * (2 + (5 * 0.5 + 2) / 6);  // its own and that of 3x2 pixels at the border
  CHECK(roots.at(1, 0) == doctest::Approx(1 / std::sqrt(level * level + 0.01 + 0.3 * 0.2)));

  // One base is right but for a lamp of 3x3 pixels, the other about the lamp only. Three of its pixels are in the
  // patch.
  const Case c = makeCase();
  const auto image = [&](float around, float lamp) {
    Rgb<float> out(c.truth.width(), c.truth.height(), around);
    for (size_t ch = 0; ch < 3; ++ch)
      for (int y = 19; y <= 21; ++y)
        for (int u = 28; u <= 30; ++u) out[ch].at(u, y) = lamp;
    return out;
  };
  const auto exactly = [&](float around, float lamp) {
    Estimate e = c.pt();
    e.mean = e.half[0] = e.half[1] = image(around, lamp);
    e.variance = image(0, 0);
    return e;
  };
  const Estimate x = exactly(0.1f, 2), lamp = exactly(0.4f, 2), dark = exactly(0.1f, 0.1f);
  MethodInputs in = inputsOf(c);
  in.unbiased = &x;
  in.features = nullptr;
  in.bases = {&lamp, &dark};
  in.options.set("ensemble-filter", 0);
  const auto beside = [&](double relative) {
    in.options.set("ensemble-relative", relative);
    return make_ensemble()->run(in).image.mean[0].at(33, 20);
  };
  CHECK(beside(1) < 0.2f);
  CHECK(beside(0) > 0.28f);
}

TEST_CASE("The filter of weights is the formula near corners and where tiles meet") {
  CaseOptions o;
  o.width = 70;
  o.height = 38;
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  const WeightMaps raw = ensembleWeights(*in.unbiased, in.bases, {.patchRadius = 0});
  const Estimate z = weightedEstimate(raw, in.bases);
  const WeightMaps maps = filteredWeights(raw, z, in.features);
  REQUIRE(maps.bases == 3);
  const auto spread = [&](size_t i) {
    double v = 0;
    for (size_t k = 0; k < 3; ++k)
      v += 0.5 * sqr(static_cast<double>(z.half[0][k][i] - z.half[1][k][i])) +
           0.5e-6 * sqr(static_cast<double>(z.mean[k][i]));
    return v + 0.5e-10;
  };
  for (const auto& [px, py] : {std::pair{2, 1}, {63, 31}, {64, 32}, {60, 35}, {69, 37}}) {
    const size_t p = z.mean[0].index(px, py);
    double sums[3] = {}, norm = 0;
    for (int y = std::max(0, py - 7); y <= std::min(o.height - 1, py + 7); ++y)
      for (int x = std::max(0, px - 7); x <= std::min(o.width - 1, px + 7); ++x) {
        const size_t q = z.mean[0].index(x, y);
        double dz = 0, da = 0, dn = 0;
        for (size_t k = 0; k < 3; ++k) {
          dz += sqr(static_cast<double>(z.mean[k][p] - z.mean[k][q]));
          da += sqr(static_cast<double>(in.features->albedo.mean[k][p] - in.features->albedo.mean[k][q]));
          dn += sqr(static_cast<double>(in.features->normal.mean[k][p] - in.features->normal.mean[k][q]));
        }
        const double e = ((x - px) * (x - px) + (y - py) * (y - py)) / 18.0 + dz / (spread(p) + spread(q)) / 8 +
                         da / (2 * 0.25 * 0.25) + dn / (2 * 0.15 * 0.15);
        for (size_t b = 0; b < 3; ++b) sums[b] += std::exp(-e) * static_cast<double>(raw.of(b, 2)[q]);
        norm += std::exp(-e);
      }
    for (size_t b = 0; b < 3; ++b)
      CHECK(static_cast<double>(maps.of(b, 2)[p]) == doctest::Approx(sums[b] / norm).epsilon(1e-4));
  }
}

}  // namespace braid::test_ensemble_weights
