// SPDX-License-Identifier: Apache-2.0
// The one-hot baselines of ensembles: estimated errors, selections, and the filters that smooth either.
#include <algorithm>
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/ensemble/one_hot/one_hot.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_one_hot {

using namespace test;

TEST_CASE("One-hot: estimated errors of fixed images are right on average, and selections are one-hot") {
  CaseOptions o;
  o.width = 128;
  o.height = 96;
  const Case c = makeCase(o);
  // An image of a known error, which has seen no sample: the estimate of it has the mean 0.09.
  Estimate offset = c.find("wide");
  offset.mean = c.truth;
  for (size_t k = 0; k < 3; ++k)
    for (float& v : offset.mean[k].data) v += 0.3f;
  offset.half[0] = offset.half[1] = offset.mean;
  const std::vector<Plane<float>> errors = baseErrors(c.pt(), {&offset, &c.find("wide")});
  double mean = 0, square = 0;
  const auto n = static_cast<double>(errors[0].size());
  for (const float e : errors[0].data) mean += static_cast<double>(e) / n, square += sqr(static_cast<double>(e)) / n;
  // Four standard errors: a false alarm in 16000.
  CHECK(std::fabs(mean - 0.09) < 4 * std::sqrt((square - mean * mean) / n));
  const WeightMaps maps = selectionMaps(errors);
  for (size_t i = 0; i < maps.planes[0].size(); ++i) {
    CHECK(maps.planes[0][i] + maps.planes[1][i] == 1);
    CHECK((maps.planes[0][i] == 1) == (errors[0][i] <= errors[1][i]));
  }
}

TEST_CASE("One-hot methods select by pixel, and smoothing selections beats the raw selection") {
  CaseOptions o;
  o.samples = 64;
  const Case c = makeCase(o);
  const MethodInputs in = inputsOf(c);
  const WeightMaps raw = selectionMaps(baseErrors(c.pt(), in.bases));
  const double rawError = meanSquaredError(weightedEstimate(raw, in.bases).mean, c.truth);
  for (const auto& method : {make_one_hot_sbf(), make_one_hot_nfor(), make_one_hot_post()}) {
    const MethodResult r = method->run(in);
    CAPTURE(std::string(method->name()));
    const double error = meanSquaredError(r.image.mean, c.truth);
    MESSAGE(std::string(method->name()), " ", error, ", unsmoothed ", rawError);
    CHECK(error < rawError);
    const bool binary = std::string(method->name()) != "one-hot-post";
    bool hot = true;
    for (size_t i = 0; i < r.error.size(); ++i) {
      int ones = 0;
      for (const NamedPlane& p : r.aovs) ones += p.plane[i] == 1 ? 1 : 0;
      hot = hot && ones == 1;
    }
    CHECK(hot == binary);
  }
}

TEST_CASE("The SBF filter keeps constants and is the formula at a pixel") {
  const Case c = caseOf(20, 14, 32);
  const std::vector<Plane<float>> flat = {Plane<float>(20, 14, 0.37f)};
  const std::vector<Plane<float>> kept = featureFiltered(flat, &*c.estimates.features, 32);
  for (const float v : kept[0].data) CHECK(v == doctest::Approx(0.37f).epsilon(1e-5));
  const Features& g = *c.estimates.features;
  const std::vector<Plane<float>> ramp = {c.truth[0]};
  const Plane<float> filtered = featureFiltered(ramp, &g, 32)[0];
  std::vector<float> depths(g.depth.mean.data.begin(), g.depth.mean.data.end());
  std::sort(depths.begin(), depths.end());
  const double deepest =
      static_cast<double>(depths[static_cast<size_t>(0.999 * static_cast<double>(depths.size() - 1))]);
  const auto term = [](double square, double variance, double sigma) {
    return square / (2 * sigma * sigma * std::max(variance, 0.01));
  };
  double top = 0, bottom = 0;
  const size_t p = ramp[0].index(3, 6);
  for (size_t q = 0; q < ramp[0].size(); ++q) {
    const int dx = static_cast<int>(q % 20) - 3, dy = static_cast<int>(q / 20) - 6;
    if (std::abs(dx) > 16 || std::abs(dy) > 16) continue;
    double squares[2] = {0, 0}, variances[2] = {0, 0};
    for (size_t k = 0; k < 3; ++k)
      for (size_t which = 0; which < 2; ++which) {
        const FeaturePlanes<Rgb<float>>& planes = which == 0 ? g.normal : g.albedo;
        squares[which] += sqr(static_cast<double>(planes.mean[k][p]) - static_cast<double>(planes.mean[k][q]));
        variances[which] += 32 * static_cast<double>(planes.variance[k][p] + planes.variance[k][q]);
      }
    const double depth = sqr(static_cast<double>(g.depth.mean[p] - g.depth.mean[q]) / deepest);
    const double depthVariance = 32 * static_cast<double>(g.depth.variance[p] + g.depth.variance[q]) / sqr(deepest);
    const double w = std::exp(-(dx * dx + dy * dy) / 128.0 - term(squares[0], variances[0], 0.8) -
                              term(squares[1], variances[1], 0.25) - term(depth, depthVariance, 0.6));
    top += w * static_cast<double>(ramp[0][q]);
    bottom += w;
  }
  CHECK(static_cast<double>(filtered[p]) == doctest::Approx(top / bottom).epsilon(1e-4));
}

TEST_CASE("The SBF filter does not cross edges of features") {
  Features f = *caseOf(20, 14, 32).estimates.features;
  for (size_t i = 0; i < f.depth.mean.size(); ++i) {
    const float side = i % 20 < 10 ? 0.0f : 1.0f;
    f.normal.mean.set(i, Vec3(side, 0, 1 - side));
  }
  std::vector<Plane<float>> in = {Plane<float>(20, 14)};
  for (size_t i = 0; i < in[0].size(); ++i) in[0][i] = i % 20 < 10 ? 1.0f : -1.0f;
  const Plane<float> out = featureFiltered(in, &f, 32)[0];
  CHECK(out.at(2, 7) > 0.999f);
  CHECK(out.at(17, 7) < -0.999f);
  // Without features a Gaussian of deviation 8 remains.
  const Plane<float> blurred = featureFiltered(in, nullptr, 32)[0];
  double sum = 0, norm = 0;
  for (int x = 0; x < 20; ++x) {
    const double w = std::exp(-(x - 9) * (x - 9) / 128.0);
    sum += w * (x < 10 ? 1 : -1);
    norm += w;
  }
  CHECK(static_cast<double>(blurred.at(9, 7)) == doctest::Approx(sum / norm).epsilon(1e-4));
}

}  // namespace braid::test_one_hot
