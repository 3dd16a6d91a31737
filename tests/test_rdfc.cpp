// SPDX-License-Identifier: Apache-2.0
// RDFC: its filters against plain double-precision transcriptions, what the choice between the candidates is for, and
// what the method promises.
#include <array>
#include <cmath>
#include <functional>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/rdfc_candidates.h"
#include "combiners/denoise/rdfc_features.h"
#include "combiners/denoise/rdfc_filter.h"
#include "combiners/denoise/rdfc_window.h"
#include "combiners/mirror.h"
#include "combiners/registry.h"
#include "renderer/core/error.h"
#include "tests/combiner_fixture.h"

using namespace braid;
using namespace braid::test;

namespace {

double at(const MirroredPlane& p, int x, int y) {
  return static_cast<double>(p.at(mirrorIndex(x, p.width()), mirrorIndex(y, p.height()))[0]);
}

// The three distances and weights of a triple, straight from the formulas, in double.
struct PlainTriple {
  double forward = 0, backward = 0, both = 0;
};

struct PlainTest {
  double k = 1;
  double floor = 0;
  bool feature = false, own = false;
  double raise = 0;  // relative change of the centre pixel's value
};

// Of the pixels (x, y) and (x ± dx, y ± dy), averaged over the channels.
PlainTriple pixelDistances(const RdfcGuide& guide, const PlainTest& t, int x, int y, int dx, int dy) {
  PlainTriple d;
  for (const RdfcChannel& c : guide) {
    const double up = at(c.mean, x, y) * (1 + t.raise), uq = at(c.mean, x + dx, y + dy),
                 ur = at(c.mean, x - dx, y - dy);
    const double vp = at(c.variance, x, y), vq = std::min(vp, at(c.variance, x + dx, y + dy));
    const double vr = std::min(vp, at(c.variance, x - dx, y - dy));
    const auto spread = [&](int a, int b) {
      return t.feature ? std::max(at(c.spread, a, b), t.floor) : at(c.variance, a, b);
    };
    const double sp = spread(x, y), sq = t.own ? sp : spread(x + dx, y + dy), sr = t.own ? sp : spread(x - dx, y - dy);
    const double n = static_cast<double>(guide.size()), k2 = t.k * t.k, eps = 1e-10;
    d.forward += (sqr(up - uq) - (vp + vq)) / (eps + k2 * (sp + sq)) / n;
    d.backward += (sqr(up - ur) - (vp + vr)) / (eps + k2 * (sp + sr)) / n;
    d.both += (sqr(up - (uq + ur) / 2) - (vp + (vq + vr) / 4)) / (eps + k2 * (t.own ? 2 * sp : sp + (sq + sr) / 4)) / n;
  }
  return d;
}

PlainTriple boxed(int radius, const std::function<PlainTriple(int, int)>& value) {
  PlainTriple sum;
  const double n = sqr(2.0 * radius + 1);
  for (int j = -radius; j <= radius; ++j)
    for (int i = -radius; i <= radius; ++i) {
      const PlainTriple d = value(i, j);
      sum.forward += d.forward / n;
      sum.backward += d.backward / n;
      sum.both += d.both / n;
    }
  return sum;
}

PlainTriple weightsOf(const PlainTriple& d) {
  const auto w = [](double v) { return std::exp(-std::max(0.0, v)); };
  return {w(d.forward), w(d.backward), w(d.both)};
}

PlainTriple blended(const PlainTriple& w, const PlainTriple& d) {
  double a = 0;
  if (d.forward < 25 && d.backward < 25) a = std::clamp(w.both / (w.forward + w.backward) - 1, 0.0, 1.0);
  return {w.forward + a * (w.both - w.forward), w.backward + a * (w.both - w.backward), a};
}

// The weights of the neighbours of (x, y): patches of the colour, smoothed or not, and single pixels of the features.
// A raised centre moves the distance of the centre pair alone.
struct PlainFilter {
  const RdfcGuide* guide = nullptr;
  PlainTest colour, feature;
  int patch = 3, smoothing = 0;
  const std::vector<RdfcGuide>* features = nullptr;
  int window = 5;

  PlainTriple patchDistance(int x, int y, int dx, int dy) const {
    return boxed(patch, [&](int i, int j) {
      PlainTest t = colour;
      if (i != 0 || j != 0) t.raise = 0;
      return pixelDistances(*guide, t, x + i, y + j, dx, dy);
    });
  }

  PlainTriple weights(int x, int y, int dx, int dy) const {
    PlainTriple out = {1, 1, 0};
    const auto keep = [&out](const PlainTriple& w) {
      out = {std::min(out.forward, w.forward), std::min(out.backward, w.backward), out.both + w.both};
    };
    if (guide)
      keep(blended(boxed(smoothing, [&](int i, int j) { return weightsOf(patchDistance(x + i, y + j, dx, dy)); }),
                   patchDistance(x, y, dx, dy)));
    if (features)
      for (const RdfcGuide& f : *features) {
        const PlainTriple d = pixelDistances(f, feature, x, y, dx, dy);
        keep(blended(weightsOf(d), d));
      }
    return out;
  }

  // The weighted mean of a target at a pixel. `means`: how often the mean of two neighbours counted.
  double value(const MirroredPlane& target, int x, int y, double* ownShare = nullptr, double* means = nullptr) const {
    double sum = 0, total = 0, most = 1e-3;
    forEachRdfcOffset(window, [&](int dx, int dy) {
      const PlainTriple w = weights(x, y, dx, dy);
      sum += w.forward * at(target, x + dx, y + dy) + w.backward * at(target, x - dx, y - dy);
      total += w.forward + w.backward;
      most = std::max({most, w.forward, w.backward});
      if (means) *means += w.both;
    });
    if (ownShare) *ownShare = most / (total + most);
    return (sum + most * at(target, x, y) * (1 + colour.raise)) / (total + most);
  }
};

RdfcColour colourOf(const Estimate& e) {
  RdfcColour c;
  for (size_t k = 0; k < 3; ++k) c.guide.push_back({MirroredPlane(e.mean[k]), MirroredPlane(e.variance[k]), {}});
  for (const Rgb<float>& half : e.half)
    c.images.push_back({MirroredPlane(half[0]), MirroredPlane(half[1]), MirroredPlane(half[2])});
  c.shares = {0.5f, 0.5f};
  return c;
}

RdfcResult denoised(const Case& c, const RdfcOptions& options = {}, bool features = true) {
  return rdfcDenoised(c.pt(), features ? &*c.estimates.features : nullptr, options);
}

Case cleanCase() {
  CaseOptions o;
  o.noise = o.featureNoise = 0;
  return makeCase(o);
}

CaseOptions sized(int width, int height, uint64_t samples) {
  CaseOptions o;
  o.width = width;
  o.height = height;
  o.samples = samples;
  return o;
}

}  // namespace

TEST_CASE("The plain filter of RDFC is what its formula says, with and without features, also in tiny images") {
  for (const auto& [width, height] : {std::array{1, 1}, {7, 3}, {24, 20}}) {
    Case c = caseOf(width, height, 16);
    const std::vector<RdfcGuide> features = rdfcFeatures(*c.estimates.features, 16);
    // A ramp, where the mean of two neighbours counts.
    Estimate& e = c.estimates.estimates[0];
    for (size_t k = 0; k < 3; ++k)
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          e.mean[k].at(x, y) = 0.2f * static_cast<float>(x) + 0.05f * e.mean[k].at(x, y);
          e.variance[k].at(x, y) = 0.01f + 0.0025f * e.variance[k].at(x, y);
        }
    const RdfcColour colour = colourOf(e);
    for (const bool own : {false, true}) {
      RdfcWindowFilter filter;
      filter.guide = &colour.guide;
      filter.k = 0.7f;
      filter.window = 3;
      filter.spread = own ? rdfc::Spread::Own : rdfc::Spread::Both;
      filter.features = own ? &features : nullptr;
      const std::vector<Plane<float>> out = rdfcFiltered(filter, colour.images[0]);
      PlainFilter plain;
      plain.guide = &colour.guide;
      plain.colour = {static_cast<double>(0.7f), 0, false, own};
      plain.feature = {0.6, 1e-4, true, true};
      plain.smoothing = 2;
      plain.window = 3;
      plain.features = filter.features;
      double worst = 0, means = 0;
      for (int y = 0; y < height; y += 3)
        for (int x = 0; x < width; x += 2)
          worst = std::max(worst, std::fabs(static_cast<double>(out[1].at(x, y)) -
                                            plain.value(colour.images[0][1], x, y, nullptr, &means)));
      CAPTURE(width);
      CHECK(worst < 1e-4);
      if (width == 24) CHECK(means > 1);  // or their code was not tested
    }
  }
}

TEST_CASE("The candidates of RDFC and their risk are what their formulas say") {
  const Case c = caseOf(40, 24, 16);
  const RdfcColour colour = colourOf(c.pt());
  const std::vector<RdfcGuide> features = rdfcFeatures(*c.estimates.features, 16);
  const std::vector<RdfcCandidate> candidates = rdfcCandidates(colour, features);
  REQUIRE(candidates.size() == 3);
  for (size_t k = 0; k < 3; ++k) {
    PlainFilter plain;
    plain.guide = k < 2 ? &colour.guide : nullptr;
    plain.colour.k = 0.45;
    plain.feature = {0.6, k < 2 ? 1e-3 : 1e-4, true, false};
    plain.patch = k == 0 ? 1 : 3;
    plain.features = &features;
    plain.window = 10;
    double worst = 0, worstRisk = 0, differences = 0;
    for (const auto& [x, y] : {std::array{0, 0}, {3, 20}, {11, 9}, {20, 12}, {27, 5}, {39, 23}}) {
      double risk = 0, share = 0, slopes[3], f[3];
      bool valid = k < 2;
      for (size_t ch = 0; ch < 3; ++ch) {
        const MirroredPlane& noisy = colour.guide[ch].mean;
        f[ch] = plain.value(noisy, x, y, &share);
        worst = std::max(worst, std::fabs(plain.value(colour.images[1][ch], x, y) -
                                          static_cast<double>(candidates[k].images[1][ch].at(x, y))));
        PlainFilter raised = plain;
        raised.colour.raise = 0.01;
        slopes[ch] = (raised.value(noisy, x, y) - f[ch]) / (0.01 * at(noisy, x, y));
        valid = valid && slopes[ch] >= 0 && slopes[ch] <= 1;
      }
      for (size_t ch = 0; ch < 3; ++ch) {
        const double v = at(colour.guide[ch].variance, x, y), slope = valid ? slopes[ch] : share;
        risk += (sqr(f[ch] - at(colour.guide[ch].mean, x, y)) + 2 * v * slope - v) / 3;
        differences += valid ? std::fabs(slopes[ch] - share) : 0;
      }
      worstRisk = std::max(worstRisk, std::fabs(risk - static_cast<double>(candidates[k].risk.at(x, y))));
    }
    CAPTURE(k);
    CHECK(worst < 1e-4);
    CHECK(worstRisk < 1e-3);
    if (k < 2) CHECK(differences > 0.01);  // the difference quotient is at work
  }
}

TEST_CASE("The risk of a candidate is its squared error, on average") {
  // Inside of the margin where a mirrored window holds its centre twice, of which the risk knows nothing.
  double risk[3] = {0, 0, 0}, error[3] = {0, 0, 0};
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    CaseOptions o = sized(96, 64, 32);
    o.noise = 0.9;
    o.seed = seed;
    const Case c = makeCase(o);
    const RdfcColour colour = colourOf(c.pt());
    const auto candidates = rdfcCandidates(colour, rdfcFeatures(*c.estimates.features, 32));
    for (size_t k = 0; k < 3; ++k) {
      const Rgb<float> mean = average(candidates[k].images[0], candidates[k].images[1]);
      for (int y = 10; y < 54; ++y)
        for (int x = 10; x < 86; ++x) {
          risk[k] += static_cast<double>(candidates[k].risk.at(x, y));
          for (size_t ch = 0; ch < 3; ++ch)
            error[k] += sqr(static_cast<double>(mean[ch].at(x, y)) - static_cast<double>(c.truth[ch].at(x, y))) / 3;
        }
    }
  }
  for (size_t k = 0; k < 3; ++k) {
    CAPTURE(k);
    CAPTURE(risk[k] / error[k]);
    CHECK(risk[k] > 0.5 * error[k]);
    CHECK(risk[k] < 2 * error[k]);
  }
}

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
