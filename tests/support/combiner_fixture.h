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
#include <vector>

#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"
#include "combiners/method.h"
#include "renderer/film/moments.h"

namespace braid::test {

struct CaseOptions {
  int width = 64, height = 48;
  uint64_t samples = 32;  // passes of every estimate
  uint64_t seed = 1;
  double noise = 2;            // standard deviation of one sample, relative to the truth
  double fireflies = 0;        // share of the samples that are 200 times brighter
  double light = 1;            // multiplies the truth and so everything but the features
  double constant = -1;        // not negative: every pixel of the truth has this value (times light), noise stays
  double correlatedNoise = 1;  // as `noise`, of the estimate by common random numbers
  double photonNoise = 0.25;   // as `noise`, of the biased estimate
  int photonBlur = 3;          // radius of the box that blurs the biased estimate
  // What the biased estimate tells of its bias: its excess over a box of half the radius, as photon maps do, which is
  // less than all at edges; or all of it.
  bool allBiasEstimated = false;
  double featureNoise = 0.05;  // standard deviation of one sample of a feature component
};

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

inline double uniform(uint64_t seed, uint64_t stream, uint64_t pass, uint64_t item) {
  const uint64_t h = hashCombine(hashCombine(hashCombine(seed, stream), pass), item);
  return (static_cast<double>(h >> 11) + 0.5) * 0x1p-53;
}

// A factor of mean 1 and standard deviation `noise`, never negative: above 1 by samples that are rarely not black.
inline double factor(double u, double noise) {
  if (noise <= 1) return 1 + noise * (-std::log(u) - 1);
  const double share = 2 / (1 + noise * noise);
  return u < share ? -std::log(u / share) / share : 0.0;
}

// Averages over windows of (2 radius + 1)² pixels clipped at the borders.
inline Rgb<float> boxFilter(const Rgb<float>& in, int radius) {
  Rgb<float> out(in.width(), in.height());
  parallelRows(in.height(), [&](int y) {
    for (int x = 0; x < in.width(); ++x)
      for (size_t c = 0; c < 3; ++c) {
        double sum = 0, count = 0;
        for (int j = std::max(0, y - radius); j <= std::min(in.height() - 1, y + radius); ++j)
          for (int i = std::max(0, x - radius); i <= std::min(in.width() - 1, x + radius); ++i, ++count)
            sum += static_cast<double>(in[c].at(i, j));
        out[c].at(x, y) = static_cast<float>(sum / count);
      }
  });
  return out;
}

struct SurfacePoint {
  Spectrum albedo{0};
  Vec3 normal{0, 0, 1};
  float depth = 0, visibility = 0;
  Spectrum radiance{0};
  uint64_t region = 0;
};

// The scene at a pixel: coordinates relative to the height, so that the picture has the same shape at any size.
inline SurfacePoint surfaceAt(int x, int y, int width, int height, const CaseOptions& o) {
  const double u = (x + 0.5) / height, v = (y + 0.5) / height;
  const double dx = u - 0.5 * width / height, dy = v - 0.45, r2 = (dx * dx + dy * dy) / (0.3 * 0.3);
  SurfacePoint p;
  if (r2 < 1) {
    p.region = 1;
    p.normal = glm::normalize(Vec3(dx / 0.3, dy / 0.3, std::sqrt(1 - r2)));
    p.albedo = Spectrum(0.75f, 0.3f, 0.2f);
    p.depth = static_cast<float>(3 - 0.3 * std::sqrt(1 - r2));
  } else {
    const bool dark = (static_cast<int>(std::floor(u * 6)) + static_cast<int>(std::floor(v * 6))) % 2 != 0;
    p.region = dark ? 3 : 2;
    p.albedo = dark ? Spectrum(0.15f, 0.2f, 0.35f) : Spectrum(0.8f, 0.75f, 0.6f);
    p.depth = static_cast<float>(3 + v);
  }
  const bool shadow = u + 0.6 * v < 0.55;
  p.visibility = shadow ? 0.1f : 1.0f;
  const double light = (shadow ? 0.2 : 1.2) * (0.4 + 0.8 * v) * (0.5 + 0.5 * static_cast<double>(p.normal.z));
  p.radiance = static_cast<float>(o.light) *
               (o.constant >= 0 ? Spectrum(static_cast<float>(o.constant)) : p.albedo * static_cast<float>(light));
  return p;
}

// Sums of samples in four buckets, as a film keeps them.
struct Sums {
  double bucket[4] = {0, 0, 0, 0}, square = 0;
  uint64_t count[4] = {0, 0, 0, 0};
  void add(uint64_t pass, double value) {
    bucket[pass % 4] += value;
    square += value * value;
    ++count[pass % 4];
  }
  float ratio(int a, int b, int c, int d) const {
    double sum = 0, n = 0;
    for (int k : {a, b, c, d})
      if (k >= 0) {
        sum += bucket[k];
        n += static_cast<double>(count[k]);
      }
    return n > 0 ? static_cast<float>(sum / n) : 0.0f;
  }
  float mean() const { return ratio(0, 1, 2, 3); }
  float half(int h) const { return ratio(h, h + 2, -1, -1); }
  float variance() const {
    return static_cast<float>(varianceOfMean(bucket[0] + bucket[1] + bucket[2] + bucket[3], square,
                                             count[0] + count[1] + count[2] + count[3]));
  }
};

// An estimate from sample(pass, pixel, channel). `history` gets the variances at the passes 1, 2, 4, …
template <class Sample>
Estimate estimateOfSamples(const std::string& name, const CaseOptions& o, const Sample& sample,
                           std::vector<Checkpoint>* history = nullptr) {
  Estimate e;
  e.name = name;
  e.passes = o.samples;
  e.seconds = 0.01 * static_cast<double>(o.samples);
  const Rgb<float> zero(o.width, o.height);
  e.mean = e.half[0] = e.half[1] = e.variance = zero;
  e.quarter.assign(4, zero);
  if (history)
    for (uint64_t n = 1; n <= o.samples; n *= 2) history->push_back({n, 0.01 * static_cast<double>(n), zero});
  parallelRows(o.height, [&](int y) {
    for (int x = 0; x < o.width; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const size_t i = zero[0].index(x, y);
        Sums sums;
        size_t checkpoint = 0;
        for (uint64_t pass = 0; pass < o.samples; ++pass) {
          sums.add(pass, sample(pass, i, c));
          if (history && ((pass + 1) & pass) == 0) (*history)[checkpoint++].variance[c][i] = sums.variance();
        }
        e.mean[c][i] = sums.mean();
        e.variance[c][i] = sums.variance();
        for (int h = 0; h < 2; ++h) e.half[h][c][i] = sums.half(h);
        for (int q = 0; q < 4; ++q) e.quarter[static_cast<size_t>(q)][c][i] = sums.ratio(q, -1, -1, -1);
      }
  });
  return e;
}

template <class P, class Get>
void featureFromSums(FeaturePlanes<P>& f, const Get& plane, size_t i, const Sums& s) {
  plane(f.mean)[i] = s.mean();
  plane(f.half[0])[i] = s.half(0);
  plane(f.half[1])[i] = s.half(1);
  plane(f.variance)[i] = s.variance();
}

inline Features makeFeatures(const CaseOptions& o) {
  Features f;
  for (FeaturePlanes<Rgb<float>>* p : {&f.albedo, &f.normal})
    p->mean = p->half[0] = p->half[1] = p->variance = Rgb<float>(o.width, o.height);
  for (FeaturePlanes<Plane<float>>* p : {&f.depth, &f.visibility})
    p->mean = p->half[0] = p->half[1] = p->variance = Plane<float>(o.width, o.height);
  parallelRows(o.height, [&](int y) {
    for (int x = 0; x < o.width; ++x) {
      const SurfacePoint p = surfaceAt(x, y, o.width, o.height, o);
      const size_t i = f.depth.mean.index(x, y);
      const float truth[8] = {p.albedo.x, p.albedo.y, p.albedo.z, p.normal.x,
                              p.normal.y, p.normal.z, p.depth,    p.visibility};
      for (size_t k = 0; k < 8; ++k) {
        Sums s;
        for (uint64_t pass = 0; pass < o.samples; ++pass)
          s.add(pass, static_cast<double>(truth[k]) +
                          o.featureNoise * std::sqrt(12.0) * (uniform(o.seed, 10 + k, pass, i) - 0.5));
        const auto rgb = [k](Rgb<float>& planes) -> Plane<float>& { return planes[k % 3]; };
        const auto single = [](Plane<float>& plane) -> Plane<float>& { return plane; };
        if (k < 6)
          featureFromSums(k < 3 ? f.albedo : f.normal, rgb, i, s);
        else
          featureFromSums(k == 6 ? f.depth : f.visibility, single, i, s);
      }
    }
  });
  return f;
}

inline Estimate boxDenoised(const std::string& name, const Estimate& of, int radius) {
  Estimate e;
  e.name = name;
  e.unbiased = false;
  e.passes = of.passes;
  e.mean = boxFilter(of.mean, radius);
  for (int h = 0; h < 2; ++h) e.half[h] = boxFilter(of.half[h], radius);
  return e;
}

}  // namespace detail

inline Case makeCase(const CaseOptions& o = {}) {
  Case result;
  result.options = o;
  result.truth = Rgb<float>(o.width, o.height);
  Plane<int> region(o.width, o.height);
  parallelRows(o.height, [&](int y) {
    for (int x = 0; x < o.width; ++x) {
      const detail::SurfacePoint p = detail::surfaceAt(x, y, o.width, o.height, o);
      result.truth.set(region.index(x, y), p.radiance);
      region.at(x, y) = static_cast<int>(p.region);
    }
  });
  Estimates& e = result.estimates;
  e.width = o.width;
  e.height = o.height;
  e.window = {0, 0, o.width, o.height};
  e.fullWidth = o.width;
  e.fullHeight = o.height;
  e.seed = o.seed;
  e.features = detail::makeFeatures(o);

  const auto item = [](size_t i, size_t c) { return 3 * static_cast<uint64_t>(i) + c; };
  const double firefly = 200, ordinary = (1 - o.fireflies * firefly) / (1 - o.fireflies);
  std::vector<Checkpoint> history;
  e.estimates.push_back(detail::estimateOfSamples(
      "pt", o,
      [&](uint64_t pass, size_t i, size_t c) {
        const double g = detail::factor(detail::uniform(o.seed, 0, pass, item(i, c)), o.noise);
        const double f = o.fireflies <= 0                                             ? 1
                         : detail::uniform(o.seed, 1, pass, item(i, 0)) < o.fireflies ? firefly
                                                                                      : ordinary;
        return static_cast<double>(result.truth[c][i]) * g * f;
      },
      &history));
  e.history["pt"] = std::move(history);

  // One random number a pass and region, shifted slowly over the image: equal neighbours get nearly equal samples.
  e.estimates.push_back(detail::estimateOfSamples("crn", o, [&](uint64_t pass, size_t i, size_t c) {
    const double shift = 0.2 * static_cast<double>(i % static_cast<size_t>(o.width)) / o.width;
    double u = detail::uniform(o.seed, 2, pass, static_cast<uint64_t>(region[i])) + shift;
    u -= std::floor(u);
    return static_cast<double>(result.truth[c][i]) * detail::factor(std::max(u, 1e-12), o.correlatedNoise);
  }));
  e.estimates.back().correlation = Correlation::CommonRandomNumbers;

  const Rgb<float> blurred = detail::boxFilter(result.truth, o.photonBlur);
  e.estimates.push_back(detail::estimateOfSamples("sppm", o, [&](uint64_t pass, size_t i, size_t c) {
    const double u = detail::uniform(o.seed, 3, pass, item(i, c));
    return static_cast<double>(blurred[c][i]) * detail::factor(u, o.photonNoise);
  }));
  Estimate& sppm = e.estimates.back();
  sppm.unbiased = false;
  const int innerBlur = o.allBiasEstimated ? 0 : o.photonBlur / 2;
  const Rgb<float> inner = detail::boxFilter(result.truth, innerBlur);
  // The bias under curved light goes with r (r + 1).
  const double share =
      o.photonBlur == 0 ? 0 : 1 - innerBlur * (innerBlur + 1.0) / (o.photonBlur * (o.photonBlur + 1.0));
  const Estimate bias = detail::estimateOfSamples("bias", o, [&](uint64_t pass, size_t i, size_t c) {
    const double u = detail::uniform(o.seed, 4, pass, item(i, c));
    const double excess = static_cast<double>(blurred[c][i]) - static_cast<double>(inner[c][i]);
    return (share > 0 ? excess / share : 0) * detail::factor(u, o.photonNoise);
  });
  sppm.bias = bias.mean;
  for (int h = 0; h < 2; ++h) sppm.biasHalf[h] = bias.half[h];
  sppm.biasVariance = bias.variance;

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

// A case of the given size, everything else as by default.
inline Case caseOf(int width, int height, uint64_t samples, uint64_t seed = 1, double light = 1) {
  CaseOptions o;
  o.width = width;
  o.height = height;
  o.samples = samples;
  o.seed = seed;
  o.light = light;
  return makeCase(o);
}

}  // namespace braid::test
