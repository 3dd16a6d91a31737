// SPDX-License-Identifier: Apache-2.0
// RDFC: what the choice between its candidates is for, and what the method promises.
#include <algorithm>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/rdfc/rdfc_filter.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_rdfc {

using namespace test;

namespace {

RdfcResult denoised(const Case& c, const RdfcOptions& options = {}, bool features = true) {
  return rdfcDenoised(c.pt(), features ? &*c.estimates.features : nullptr, options);
}

Case cleanCase() {
  CaseOptions o;
  o.noise = o.featureNoise = 0;
  return makeCase(o);
}

}  // namespace

TEST_CASE("RDFC returns an image without noise, whatever the options") {
  const Case c = cleanCase();
  for (const bool demodulate : {false, true})
    for (const RdfcVariance v : {RdfcVariance::Sample, RdfcVariance::Rescaled, RdfcVariance::Shrunk})
      for (const bool features : {false, true}) {
        const RdfcResult r = denoised(c, {demodulate, v, true}, features);
        for (const Rgb<float>* image : {&r.mean, &r.half[0], &r.half[1]})
          CHECK(std::sqrt(meanSquaredError(*image, c.truth)) < 1e-3);
      }
}

TEST_CASE("RDFC leaves a 25th of the noise with features, a sixth without, and less with more samples") {
  double last = kInfinity;
  for (const uint64_t samples : {16, 64, 256}) {
    const Case c = makeCase(sized(128, 96, samples));
    const double noise = meanSquaredError(c.pt().mean, c.truth), error = meanSquaredError(denoised(c).mean, c.truth);
    const double colourOnly = meanSquaredError(denoised(c, {}, false).mean, c.truth);
    CAPTURE(samples);
    CAPTURE(noise / error);
    CAPTURE(noise / colourOnly);
    CHECK(error < noise / 25);
    CHECK(colourOnly < noise / 6);
    CHECK(error < 0.6 * last);
    last = error;
  }
}

TEST_CASE("Features choose on a texture that they show, colour on a shadow that they do not") {
  CaseOptions o = sized(128, 96, 64);
  o.featureNoise = 0.01;
  Case c = makeCase(o);
  c.estimates.features->visibility = {};
  const RdfcResult r = denoised(c);
  double third[2] = {0, 0}, count[2] = {0, 0}, error = 0, noise = 0;
  for (int y = 4; y < 92; ++y)
    for (int x = 4; x < 124; ++x) {
      // Distance from the edge of the shadow in pixels, of 96 in the height.
      const double u = (x + 0.5) / 96, v = (y + 0.5) / 96, edge = 96 * std::fabs(u + 0.6 * v - 0.55) / std::sqrt(1.36);
      if (edge > 1.5 && edge < 14) continue;
      const bool shadow = edge <= 1.5;
      third[shadow] += static_cast<double>(r.selection[2].at(x, y));
      ++count[shadow];
      if (!shadow) continue;
      error += sqr(static_cast<double>(r.mean[0].at(x, y)) - static_cast<double>(c.truth[0].at(x, y)));
      noise += sqr(static_cast<double>(c.pt().mean[0].at(x, y)) - static_cast<double>(c.truth[0].at(x, y)));
    }
  CAPTURE(third[0] / count[0]);
  CAPTURE(third[1] / count[1]);
  CAPTURE(error / noise);
  CHECK(third[0] > 0.5 * count[0]);
  CHECK(third[1] < 0.1 * count[1]);
  CHECK(error < 0.5 * noise);
}

TEST_CASE("The shares of the candidates add up to one") {
  const RdfcResult r = denoised(caseOf(64, 48, 16));
  for (size_t i = 0; i < r.risk.size(); ++i)
    CHECK(r.selection[0][i] + r.selection[1][i] + r.selection[2][i] == doctest::Approx(1).epsilon(1e-5));
}

TEST_CASE("Each half of RDFC follows its own colour and not the other one's") {
  Case c = caseOf(64, 48, 32);
  Estimate& e = c.estimates.estimates[0];
  // The mean stays what it is, and with it all weights of the first pass.
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < e.mean.size(); ++i) {
      e.half[0][k][i] = 1.25f * e.mean[k][i];
      e.half[1][k][i] = 0.75f * e.mean[k][i];
    }
  for (const bool secondPass : {false, true}) {
    const RdfcResult r = denoised(c, {false, RdfcVariance::Sample, secondPass});
    double worst = 0;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < e.mean.size(); ++i) {
        const double mean = static_cast<double>(r.mean[k][i]);
        worst = std::max({worst, std::fabs(static_cast<double>(r.half[0][k][i]) / mean - 1.25),
                          std::fabs(static_cast<double>(r.half[1][k][i]) / mean - 0.75)});
      }
    CHECK(worst < 1e-4);
  }
}

TEST_CASE("Halves that are not those of the mean do not replace it") {
  Case c = caseOf(64, 48, 32);
  const Rgb<float> usual = denoised(c, {false, RdfcVariance::Sample, false}).mean;
  for (Rgb<float>& half : c.estimates.estimates[0].half)
    for (Plane<float>& p : half.channel)
      for (float& v : p.data) v *= 2;
  const RdfcResult r = denoised(c, {false, RdfcVariance::Sample, false});
  // The rounding of a sum of halves may turn the choice of a candidate in a pixel.
  CHECK(std::sqrt(meanSquaredError(r.mean, usual)) < 2e-3 * meanOfImage(usual));
  CHECK(meanOfImage(r.half[0]) == doctest::Approx(2 * meanOfImage(usual)).epsilon(0.02));
}

TEST_CASE("The error map of RDFC is of the order of the error, and not below it") {
  for (const uint64_t samples : {64, 256}) {
    const Case c = makeCase(sized(128, 96, samples));
    const MethodResult r = make_rdfc()->run(inputsOf(c));
    double estimated = 0;
    for (const float v : r.error.data) estimated += static_cast<double>(v) / static_cast<double>(r.error.size());
    const double ratio = estimated / meanSquaredError(r.image.mean, c.truth);
    CAPTURE(ratio);
    CHECK(ratio > 0.8);
    CHECK(ratio < 6);
  }
}

TEST_CASE("Without features RDFC chooses between two filters on colour, as with features that show nothing") {
  Case c = caseOf(64, 48, 16);
  const RdfcResult none = denoised(c, {}, false);
  CHECK(none.selection.size() == 2);
  Features& f = *c.estimates.features;
  for (FeaturePlanes<Rgb<float>>* p : {&f.albedo, &f.normal})
    for (Rgb<float>* image : {&p->mean, &p->half[0], &p->half[1], &p->variance}) *image = Rgb<float>(64, 48, 0.5f);
  for (FeaturePlanes<Plane<float>>* p : {&f.depth, &f.visibility})
    for (Plane<float>* plane : {&p->mean, &p->half[0], &p->half[1], &p->variance}) *plane = Plane<float>(64, 48, 0.5f);
  CHECK(identical(denoised(c).mean, none.mean));
  CHECK(allFinite(none.mean));
}

TEST_CASE("Features and images without halves or variance are used as far as they go") {
  Case c = caseOf(64, 48, 32);
  const double usual = meanSquaredError(denoised(c).mean, c.truth);
  Estimate& e = c.estimates.estimates[0];
  e.half[0] = e.half[1] = {};
  const MethodResult noHalves = make_rdfc()->run(inputsOf(c));
  CHECK(noHalves.image.half[0].empty());
  CHECK(allFinite(noHalves.error));
  CHECK(meanSquaredError(noHalves.image.mean, c.truth) < 2 * usual);
  for (Rgb<float>* p : {&c.estimates.features->albedo.variance, &c.estimates.features->normal.half[1]}) *p = {};
  CHECK(meanSquaredError(make_rdfc()->run(inputsOf(c)).image.mean, c.truth) < 4 * usual);
  e.variance = {};
  CHECK_THROWS_AS(make_rdfc()->run(inputsOf(c)), Error);
}

TEST_CASE("Rescaling brings the variance of low-discrepancy samples back to that between halves") {
  Case c = caseOf(96, 64, 32);
  const Rgb<float> truth = rdfcVariance(c.pt(), RdfcVariance::Sample);
  for (Plane<float>& p : c.estimates.estimates[0].variance.channel)
    for (float& v : p.data) v *= 5;
  const Rgb<float> rescaled = rdfcVariance(c.pt(), RdfcVariance::Rescaled);
  CHECK(meanOfImage(rescaled) == doctest::Approx(meanOfImage(truth)).epsilon(0.15));
  CHECK(meanOfImage(rdfcVariance(c.pt(), RdfcVariance::Sample)) ==
        doctest::Approx(5 * meanOfImage(truth)).epsilon(1e-3));
}

TEST_CASE("Demodulation filters across a texture as fine as pixels") {
  Case c = caseOf(64, 48, 1);
  const auto albedoAt = [](size_t i) { return 0.1f + 0.8f * static_cast<float>(detail::uniform(5, 0, 0, i)); };
  CaseOptions o = sized(64, 48, 32);
  o.noise = 1;
  Estimate e = detail::estimateOfSamples("pt", o, [&](uint64_t pass, size_t i, size_t ch) {
    return static_cast<double>(albedoAt(i)) * detail::factor(detail::uniform(7, ch, pass, i), o.noise);
  });
  Features f;
  f.albedo.mean = f.albedo.half[0] = f.albedo.half[1] = Rgb<float>(64, 48);
  f.albedo.variance = Rgb<float>(64, 48);
  Rgb<float> truth(64, 48);
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < truth.size(); ++i)
      truth[k][i] = f.albedo.mean[k][i] = f.albedo.half[0][k][i] = f.albedo.half[1][k][i] = albedoAt(i);
  const double plain = meanSquaredError(rdfcDenoised(e, &f, {}).mean, truth);
  const double demodulated = meanSquaredError(rdfcDenoised(e, &f, {true, RdfcVariance::Sample, true}).mean, truth);
  CAPTURE(demodulated / plain);
  CHECK(demodulated < 0.7 * plain);
}

TEST_CASE("A firefly, two samples, no variance and tiny images leave RDFC finite and within its input") {
  for (const CaseOptions& o : {sized(1, 1, 16), sized(7, 3, 16), sized(40, 30, 2), sized(40, 30, 3)}) {
    const Case c = makeCase(o);
    const MethodResult r = make_rdfc()->run(inputsOf(c));
    for (const Rgb<float>* image : {&r.image.mean, &r.image.half[0], &r.image.half[1]}) CHECK(allFinite(*image));
    CHECK(allFinite(r.error));
  }
  Case c = caseOf(40, 30, 16);
  Estimate& e = c.estimates.estimates[0];
  for (size_t k = 0; k < 3; ++k) {  // one sample of 16, of half A
    e.mean[k].at(20, 15) = 1e5f;
    e.half[0][k].at(20, 15) = 2e5f;
    e.half[1][k].at(20, 15) = 0;
    e.variance[k].at(20, 15) = 1e10f;
  }
  const MethodResult r = make_rdfc()->run(inputsOf(c));
  CHECK(allFinite(r.image.mean));
  for (const Plane<float>& p : r.image.mean.channel) {
    CHECK(*std::max_element(p.data.begin(), p.data.end()) <= 1e5f);
    CHECK(*std::min_element(p.data.begin(), p.data.end()) >= 0);
  }
}

TEST_CASE("A single sample is refused with a reason") {
  const Case c = caseOf(20, 16, 1);
  CHECK_THROWS_AS(make_rdfc()->run(inputsOf(c)), Error);
}

TEST_CASE("The number of threads changes no bit of RDFC") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(150, 45, 8);
  const RdfcResult usual = denoised(c);
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    const RdfcResult other = arena.execute([&] { return denoised(c); });
    CHECK(identical(usual.mean, other.mean));
    CHECK(identical(usual.half[1], other.half[1]));
    CHECK(identical(usual.risk, other.risk));
  }
}

}  // namespace braid::test_rdfc
