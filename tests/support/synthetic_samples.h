// SPDX-License-Identifier: Apache-2.0
// The samples of synthetic renders (combiner_fixture.h): what a pixel shows, its noise, and estimates and features made
// of sums of samples.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "combiners/method.h"
#include "renderer/core/hash.h"
#include "renderer/core/moments.h"
#include "renderer/core/parallel.h"

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

}  // namespace braid::test
