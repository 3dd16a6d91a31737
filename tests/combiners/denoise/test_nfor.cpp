// SPDX-License-Identifier: Apache-2.0
// NFOR: what the regression of crossed halves promises, its options and its extremes.
#include <array>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/nfor/nfor_filter.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "tests/combiners/denoise/nfor_cases.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_nfor {

using namespace test;
using namespace test::nfor_cases;

namespace {

// An estimate of `truth` whose samples vary by `noise`, relative to it.
Estimate noisy(const Rgb<float>& truth, const CaseOptions& o, double noise) {
  return detail::estimateOfSamples("pt", o, [&](uint64_t pass, size_t i, size_t c) {
    const double u = detail::uniform(o.seed, 77, pass, 3 * static_cast<uint64_t>(i) + c);
    return static_cast<double>(truth[c][i]) * detail::factor(u, noise);
  });
}

}  // namespace

TEST_CASE("Images without noise are reproduced, whatever the options") {
  CaseOptions o = sized(48, 36, 8);
  o.noise = o.featureNoise = 0;
  const Case c = makeCase(o);
  for (const bool demodulate : {false, true})
    for (const int stride : {1, 2, 4}) {
      NforOptions options;
      options.demodulate = demodulate;
      options.stride = stride;
      const NforResult r = filtered(c, options);
      CAPTURE(stride);
      // Differences below sqrt(epsilon) = 3e-4 do not count as differences.
      CHECK(relativeError(r.mean, c.truth) < 2e-3);
      CHECK(relativeError(r.half[1], c.truth) < 2e-3);
    }
}

TEST_CASE("What is linear in the features is recovered from heavy noise") {
  const CaseOptions o = sized(64, 48, 16);
  CaseOptions noiseless = o;
  noiseless.featureNoise = 0;
  const Case c = makeCase(noiseless);
  const Features& f = *c.estimates.features;
  Rgb<float> truth(o.width, o.height);
  for (size_t i = 0; i < truth.size(); ++i)
    truth.set(i, Vec3(1.0f, 0.8f, 0.6f) + 0.4f * f.normal.mean.pixel(i) + 0.5f * f.albedo.mean.pixel(i));
  const Estimate e = noisy(truth, o, 3);
  for (const int stride : {1, 2}) {
    const double gain =
        meanSquaredError(e.mean, truth) / meanSquaredError(nforFilter(e, &f, plain(stride)).mean, truth);
    CAPTURE(gain);
    CHECK(gain > 60);
  }
}

TEST_CASE("With features the regression beats the zero-order filter of the same image") {
  for (const uint64_t seed : {1, 2}) {
    const Case c = caseOf(64, 48, 32, seed);
    const double zeroOrder = meanSquaredError(make_nlm()->run(inputsOf(c)).image.mean, c.truth);
    const double paper = meanSquaredError(filtered(c, plain(1)).mean, c.truth);
    const double own = meanSquaredError(filtered(c).mean, c.truth);
    CAPTURE(zeroOrder / paper);
    CAPTURE(zeroOrder / own);
    CHECK(paper < zeroOrder / 2);
    CHECK(own < zeroOrder / 6);
    CHECK(own < meanSquaredError(c.pt().mean, c.truth) / 40);
  }
}

TEST_CASE("Models at every second pixel are about as good as models everywhere") {
  double error[2] = {0, 0};
  for (const uint64_t seed : {1, 2})
    for (const int stride : {1, 2}) {
      NforOptions options;
      options.stride = stride;
      const Case c = caseOf(64, 48, 32, seed);
      error[stride - 1] += meanSquaredError(filtered(c, options).mean, c.truth);
    }
  CAPTURE(error[1] / error[0]);
  CHECK(error[1] < 1.2 * error[0]);
}

TEST_CASE("Four times the samples shrink the error of nfor") {
  double last = kInfinity;
  for (const uint64_t samples : {8, 32, 128}) {
    const Case c = caseOf(64, 48, samples);
    const double error = meanSquaredError(filtered(c).mean, c.truth);
    CHECK(error < 0.6 * last);
    last = error;
  }
}

TEST_CASE("Without features, and with empty ones, nfor is a regression on offsets that still removes noise") {
  const Case c = caseOf(64, 48, 32);
  const Features none;
  const NforResult r = nforFilter(c.pt(), nullptr), empty = nforFilter(c.pt(), &none);
  CHECK(identical(r.mean, empty.mean));
  CHECK(meanSquaredError(r.mean, c.truth) < 0.55 * meanSquaredError(c.pt().mean, c.truth));
  // On a smooth gradient offsets matter: without them the fit is flat.
  Rgb<float> ramp(96, 72);
  for (int y = 0; y < 72; ++y)
    for (int x = 0; x < 96; ++x) ramp.set(ramp[0].index(x, y), Vec3(0.5f + 0.02f * static_cast<float>(x)));
  const Estimate e = noisy(ramp, sized(96, 72, 64), 0.5);
  const double with = meanSquaredError(nforFilter(e, nullptr).mean, ramp);
  const double without = meanSquaredError(nforFilter(e, nullptr, plain(2)).mean, ramp);
  CAPTURE(without / with);
  CHECK(with < 0.5 * without);
}

TEST_CASE("Every option of nfor matters, and filtered variances keep the image") {
  const Case c = caseOf(48, 36, 16);
  const NforResult usual = filtered(c);
  for (const int which : {0, 1, 2, 3, 4}) {
    NforOptions o;
    if (which == 0) o.demodulate = false;
    if (which == 1) o.offsets = false;
    if (which == 2) o.stride = 1;
    if (which == 3) o.variance = NforVariance::Shrunk;
    if (which == 4) o.variance = NforVariance::NonLocal;
    const NforResult other = filtered(c, o);
    CAPTURE(which);
    CHECK_FALSE(identical(usual.mean, other.mean));
    CHECK(meanSquaredError(other.mean, c.truth) < 0.1 * meanSquaredError(c.pt().mean, c.truth));
  }
}

TEST_CASE("Division by the albedo pays where light varies across a texture") {
  // Without it the error is larger for each seed.
  for (const uint64_t seed : {1, 2}) {
    const Case c = caseOf(64, 48, 64, seed);
    NforOptions o;
    o.demodulate = false;
    const double gain = meanSquaredError(filtered(c, o).mean, c.truth) / meanSquaredError(filtered(c).mean, c.truth);
    CAPTURE(gain);
    CHECK(gain > 1.2);
  }
}

TEST_CASE("A lone firefly is spread out, and does not poison what lies out of reach") {
  CaseOptions o = sized(64, 48, 32);
  o.noise = 0.5;
  const Case c = makeCase(o);
  Estimate e = c.pt();
  for (size_t k = 0; k < 3; ++k) {  // one sample of half A, 3000 times brighter
    e.half[0][k].at(30, 20) += 3000.0f / 16;
    e.mean[k].at(30, 20) += 3000.0f / 32;
    e.variance[k].at(30, 20) += sqr(3000.0f / 32);
  }
  const NforResult r = nforFilter(e, &*c.estimates.features), without = filtered(c);
  CHECK(allFinite(r.mean));
  CHECK(r.mean[1].at(30, 20) < 0.1f * e.mean[1].at(30, 20));
  for (size_t k = 0; k < 3; ++k) CHECK(r.mean[k].at(2, 2) == without.mean[k].at(2, 2));
}

TEST_CASE("nfor is finite for tiny images, two samples, no variance and wild values") {
  for (const auto& [width, height] : {std::array{1, 1}, {7, 3}, {1, 30}, {30, 1}, {257, 19}})
    for (const uint64_t samples : {2, 8}) {
      const Case c = makeCase(sized(width, height, samples));
      const NforResult r = filtered(c);
      CAPTURE(width);
      CHECK(allFinite(r.mean));
      CHECK(allFinite(r.half[0]));
      CHECK(r.mean.width() == width);
      CHECK(allFinite(filtered(c, plain(1)).mean));
    }
  Case c = makeCase(sized(40, 30, 8));
  Estimate e = c.pt();
  e.variance = {};  // from the halves
  CHECK(meanSquaredError(nforFilter(e, &*c.estimates.features).mean, c.truth) <
        0.5 * meanSquaredError(c.pt().mean, c.truth));
  e = c.pt();
  e.variance = Rgb<float>(40, 30);  // nothing is noise then
  CHECK(allFinite(nforFilter(e, &*c.estimates.features).mean));
  for (size_t i = 0; i < e.mean.size(); i += 37) {
    e.mean[0][i] = e.half[1][0][i] = 1e9f;
    e.half[0][1][i] = -1e9f;
    c.estimates.features->albedo.half[0][2][i] = std::nanf("");
    c.estimates.features->depth.mean[i] = c.estimates.features->depth.half[1][i] = kInfinity;
  }
  CHECK(allFinite(nforFilter(e, &*c.estimates.features).mean));
  CHECK(allFinite(nforFilter(e, &*c.estimates.features, plain(1)).half[1]));
}

TEST_CASE("The method nfor gives the filter's images, an error near the true one, and says what it did") {
  CaseOptions o = sized(64, 48, 32);
  o.noise = 1;
  const Case c = makeCase(o);
  const MethodResult result = make_nfor()->run(inputsOf(c));
  const NforResult r = filtered(c);
  CHECK(identical(result.image.mean, r.mean));
  CHECK(identical(result.image.half[1], r.half[1]));
  double estimated = 0;
  for (const float v : result.error.data) estimated += static_cast<double>(v) / static_cast<double>(c.truth.size());
  const double ratio = estimated / meanSquaredError(average(r.half[0], r.half[1]), c.truth);
  CAPTURE(ratio);
  CHECK(ratio > 0.5);
  CHECK(ratio < 2);
  CHECK(r.report.models == 5u * 32 * 24);
  bool reported = false;
  for (const Attribute& a : result.remarks)
    if (a.name == "nfor-regression") reported = a.text.rfind("3840 models", 0) == 0;
  CHECK(reported);
  MethodInputs in = inputsOf(c);
  Estimate single = c.pt();
  single.half[0] = single.half[1] = {};
  in.unbiased = &single;
  CHECK_THROWS_AS(make_nfor()->run(in), Error);
}

TEST_CASE("The number of threads changes no bit of nfor") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(140, 40, 8);
  const NforResult usual = filtered(c);
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    const NforResult other = arena.execute([&] { return filtered(c); });
    CHECK(identical(usual.mean, other.mean));
    CHECK(identical(usual.half[0], other.half[0]));
  }
}

}  // namespace braid::test_nfor
