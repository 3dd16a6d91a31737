// SPDX-License-Identifier: Apache-2.0
// The filters of RDFC against plain double-precision transcriptions of their formulas.
#include <array>
#include <cmath>
#include <functional>

#include <doctest/doctest.h>

#include "combiners/denoise/rdfc/rdfc_candidates.h"
#include "combiners/denoise/rdfc/rdfc_features.h"
#include "combiners/denoise/rdfc/rdfc_window.h"
#include "combiners/pixels/mirror.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_rdfc_formulas {

using namespace test;

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
    CaseOptions o;
    o.width = 96;
    o.height = 64;
    o.samples = 32;
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

}  // namespace braid::test_rdfc_formulas
