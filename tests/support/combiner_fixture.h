// SPDX-License-Identifier: Apache-2.0
// Synthetic renders with a known truth, for tests of denoisers and combiners: a textured floor and a disc under light
// with a shadow edge that no feature shows, seen through noise of known variance.
//
// makeCase() is a pure function of its options, with the same bits for any number of threads. Samples are multiples of
// the truth whose factors have mean 1, so every estimate that says it is unbiased is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "combiners/method.h"
#include "tests/support/synthetic_samples.h"

namespace braid::test {

// What makeCase() returns. The estimates are "pt" (unbiased, with history), "crn" (unbiased, common random numbers) and
// "sppm" (biased, independent of the others, with its bias); all have halves, quarters and variances. `denoised` are
// box filters of pt: "narrow" (3x3) and "wide" (9x9), with halves.
struct Case {
  CaseOptions options;
  Rgb<float> truth;
  Estimates estimates;
  std::vector<Estimate> denoised;

  const Estimate& pt() const { return estimates.estimates[0]; }
  const Estimate& crn() const { return estimates.estimates[1]; }
  const Estimate& sppm() const { return estimates.estimates[2]; }
  const Estimate& find(const std::string& name) const {
    for (const Estimate& e : denoised)
      if (e.name == name) return e;
    return *estimates.find(name);
  }
};

namespace detail {

inline uint64_t item(size_t i, size_t c) { return 3 * static_cast<uint64_t>(i) + c; }

// The truth, and which surface every pixel shows.
inline void setTruth(Case& c, Plane<int>& region) {
  const CaseOptions& o = c.options;
  c.truth = Rgb<float>(o.width, o.height);
  region = Plane<int>(o.width, o.height);
  parallelRows(o.height, [&](int y) {
    for (int x = 0; x < o.width; ++x) {
      const SurfacePoint p = surfaceAt(x, y, o.width, o.height, o);
      c.truth.set(region.index(x, y), p.radiance);
      region.at(x, y) = static_cast<int>(p.region);
    }
  });
}

inline void addUnbiased(Case& c) {
  const CaseOptions& o = c.options;
  const double firefly = 200, ordinary = (1 - o.fireflies * firefly) / (1 - o.fireflies);
  std::vector<Checkpoint> history;
  c.estimates.estimates.push_back(estimateOfSamples(
      "pt", o,
      [&](uint64_t pass, size_t i, size_t k) {
        const double g = factor(uniform(o.seed, 0, pass, item(i, k)), o.noise);
        const double f = o.fireflies <= 0 ? 1 : uniform(o.seed, 1, pass, item(i, 0)) < o.fireflies ? firefly : ordinary;
        return static_cast<double>(c.truth[k][i]) * g * f;
      },
      &history));
  c.estimates.history["pt"] = std::move(history);
}

// One random number a pass and region, shifted slowly over the image: equal neighbours get nearly equal samples.
inline void addCorrelated(Case& c, const Plane<int>& region) {
  const CaseOptions& o = c.options;
  c.estimates.estimates.push_back(estimateOfSamples("crn", o, [&](uint64_t pass, size_t i, size_t k) {
    const double shift = 0.2 * static_cast<double>(i % static_cast<size_t>(o.width)) / o.width;
    double u = uniform(o.seed, 2, pass, static_cast<uint64_t>(region[i])) + shift;
    u -= std::floor(u);
    return static_cast<double>(c.truth[k][i]) * factor(std::max(u, 1e-12), o.correlatedNoise);
  }));
  c.estimates.estimates.back().correlation = Correlation::CommonRandomNumbers;
}

inline void addPhotonMap(Case& c) {
  const CaseOptions& o = c.options;
  const Rgb<float> blurred = boxFilter(c.truth, o.photonBlur);
  c.estimates.estimates.push_back(estimateOfSamples("sppm", o, [&](uint64_t pass, size_t i, size_t k) {
    return static_cast<double>(blurred[k][i]) * factor(uniform(o.seed, 3, pass, item(i, k)), o.photonNoise);
  }));
  Estimate& sppm = c.estimates.estimates.back();
  sppm.unbiased = false;
  const int innerBlur = o.allBiasEstimated ? 0 : o.photonBlur / 2;
  const Rgb<float> inner = boxFilter(c.truth, innerBlur);
  // The bias under curved light goes with r (r + 1).
  const double share =
      o.photonBlur == 0 ? 0 : 1 - innerBlur * (innerBlur + 1.0) / (o.photonBlur * (o.photonBlur + 1.0));
  const Estimate bias = estimateOfSamples("bias", o, [&](uint64_t pass, size_t i, size_t k) {
    const double excess = static_cast<double>(blurred[k][i]) - static_cast<double>(inner[k][i]);
    return (share > 0 ? excess / share : 0) * factor(uniform(o.seed, 4, pass, item(i, k)), o.photonNoise);
  });
  sppm.bias = bias.mean;
  for (int h = 0; h < 2; ++h) sppm.biasHalf[h] = bias.half[h];
  sppm.biasVariance = bias.variance;
}

}  // namespace detail

inline Case makeCase(const CaseOptions& o = {}) {
  Case result;
  result.options = o;
  Plane<int> region;
  detail::setTruth(result, region);
  Estimates& e = result.estimates;
  e.width = e.fullWidth = o.width;
  e.height = e.fullHeight = o.height;
  e.window = {0, 0, o.width, o.height};
  e.seed = o.seed;
  e.features = detail::makeFeatures(o);
  detail::addUnbiased(result);
  detail::addCorrelated(result, region);
  detail::addPhotonMap(result);
  result.denoised.push_back(detail::boxDenoised("narrow", result.pt(), 1));
  result.denoised.push_back(detail::boxDenoised("wide", result.pt(), 4));
  return result;
}

// Inputs for calling a method directly, of every kind; they point into `c`. `biased` is sppm, narrow or wide; the last
// two come with redenoise.
inline MethodInputs inputsOf(const Case& c, const std::string& biased = "sppm") {
  MethodInputs in;
  in.unbiased = &c.pt();
  in.biased = &c.find(biased);
  for (const Estimate& d : c.denoised) in.bases.push_back(&d);
  in.bases.push_back(&c.sppm());
  in.correlated = &c.crn();
  in.features = c.estimates.features ? &*c.estimates.features : nullptr;
  in.reference = &c.truth;
  const auto history = c.estimates.history.find("pt");
  if (history != c.estimates.history.end()) in.history = &history->second;
  in.seed = c.estimates.seed;
  if (biased != "sppm") {
    const int radius = biased == "narrow" ? 1 : 4;
    in.redenoise = [radius](const Rgb<float>& image) { return detail::boxFilter(image, radius); };
  }
  return in;
}

// Mean over pixels and channels of the squared difference.
inline double meanSquaredError(const Rgb<float>& image, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < truth.size(); ++i)
      sum += sqr(static_cast<double>(image[c][i]) - static_cast<double>(truth[c][i]));
  return sum / static_cast<double>(3 * truth.size());
}

inline double meanOfImage(const Rgb<float>& image) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data) sum += static_cast<double>(v);
  return sum / static_cast<double>(3 * image.size());
}

inline bool allFinite(const Plane<float>& plane) {
  return std::all_of(plane.data.begin(), plane.data.end(), [](float v) { return std::isfinite(v); });
}
inline bool allFinite(const Rgb<float>& image) {
  return allFinite(image[0]) && allFinite(image[1]) && allFinite(image[2]);
}

// The planes of a result that hold a value that is not finite, or a squared error below 0.
inline std::string badPlanes(const MethodResult& r) {
  std::string bad;
  const auto check = [&bad](bool ok, const std::string& name) {
    if (!ok) bad += name + " ";
  };
  check(allFinite(r.image.mean), "mean");
  check(allFinite(r.image.half[0]) && allFinite(r.image.half[1]), "half");
  check(allFinite(r.image.variance), "variance");
  check(allFinite(r.error) && std::all_of(r.error.data.begin(), r.error.data.end(), [](float v) { return v >= 0; }),
        "error");
  for (const NamedPlane& p : r.aovs) check(allFinite(p.plane), p.name);
  return bad;
}

// Same sizes and same bits.
inline bool identical(const Plane<float>& a, const Plane<float>& b) {
  return a.width == b.width && a.height == b.height &&
         (a.empty() || std::memcmp(a.data.data(), b.data.data(), a.size() * sizeof(float)) == 0);
}
inline bool identical(const Rgb<float>& a, const Rgb<float>& b) {
  return identical(a[0], b[0]) && identical(a[1], b[1]) && identical(a[2], b[2]);
}

// Of the given size, everything else as by default.
inline CaseOptions sized(int width, int height, uint64_t samples = 16, uint64_t seed = 1) {
  CaseOptions o;
  o.width = width;
  o.height = height;
  o.samples = samples;
  o.seed = seed;
  return o;
}

inline Case caseOf(int width, int height, uint64_t samples, uint64_t seed = 1, double light = 1) {
  CaseOptions o = sized(width, height, samples, seed);
  o.light = light;
  return makeCase(o);
}

}  // namespace braid::test
