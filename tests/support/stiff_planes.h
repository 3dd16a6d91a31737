// SPDX-License-Identifier: Apache-2.0
// What makes a synthetic render (combiner_fixture.h) stiff: other samples, variances, halves, features and claims.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/combiner_fixture.h"

namespace braid::test {

struct StiffCase {
  std::string name;
  Case c;
  // X's variance is what it is said to be times this; Y does not claim to be better than it is. Then shrinkage has
  // bounds.
  double varianceFactor = 1;
  bool honest = true;
  // Y was put in the place of what a denoiser makes: methods that run their denoiser again get Y again. Otherwise they
  // get the wide box filter of X.
  bool replacesBiased = false;
};

namespace detail {

// A sample of the unbiased image: the truth of that pixel and channel, and a uniform variate, to a value.
using StiffSample = std::function<double(uint64_t pass, size_t pixel, double truth, double u)>;

inline void refilter(Case& c) { c.denoised = {boxDenoised("narrow", c.pt(), 1), boxDenoised("wide", c.pt(), 4)}; }

// The estimate of the given index anew, from other samples.
inline void resample(Case& c, size_t index, const StiffSample& sample) {
  Estimate& old = c.estimates.estimates[index];
  std::vector<Checkpoint> history;
  Estimate e = estimateOfSamples(
      old.name, c.options,
      [&](uint64_t pass, size_t i, size_t channel) {
        const double u = uniform(c.options.seed, 20 + index, pass, 3 * i + channel);
        return sample(pass, i, static_cast<double>(c.truth[channel][i]), u);
      },
      &history);
  e.unbiased = old.unbiased;
  e.correlation = old.correlation;
  e.bias = old.bias;
  for (int h = 0; h < 2; ++h) e.biasHalf[h] = old.biasHalf[h];
  e.biasVariance = old.biasVariance;
  old = std::move(e);
  if (index > 0) return;
  c.estimates.history[old.name] = std::move(history);
  refilter(c);
}

// A factor of mean 1 and no variance: a Pareto variate of alpha 1.5.
inline double pareto(double u) { return std::pow(u, -1 / 1.5) / 3; }

// The image without any noise: halves and quarters are the mean.
inline Estimate noiseless(const std::string& name, const Rgb<float>& image, uint64_t passes) {
  Estimate e;
  e.name = name;
  e.unbiased = false;
  e.passes = passes;
  e.mean = e.half[0] = e.half[1] = image;
  e.quarter.assign(4, image);
  e.variance = Rgb<float>(image.width(), image.height());
  return e;
}

enum class Claims {
  Nothing,   // no variance and no bias are known: as a denoiser
  Honest,    // the true bias
  Exactness  // a bias and a variance of zero
};

// Y = image, with what it says of its own error.
inline StiffCase withBiased(const std::string& name, Case c, Estimate y, Claims claims) {
  y.name = "sppm";
  y.unbiased = false;
  y.correlation = Correlation::Independent;
  y.bias = y.biasHalf[0] = y.biasHalf[1] = y.biasVariance = {};
  if (claims == Claims::Nothing) y.variance = {};
  if (claims != Claims::Nothing) y.bias = y.biasVariance = Rgb<float>(c.truth.width(), c.truth.height());
  if (claims == Claims::Honest)
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < c.truth.size(); ++i) y.bias[k][i] = y.mean[k][i] - c.truth[k][i];
  c.estimates.estimates[2] = std::move(y);
  return {name, std::move(c), 1, claims != Claims::Exactness, true};
}

inline Rgb<float> shifted(const Rgb<float>& image, float by) {
  Rgb<float> out = image;
  for (Plane<float>& p : out.channel)
    for (float& v : p.data) v += by;
  return out;
}

template <class Image>
void scale(Image& image, float factor) {
  for (size_t c = 0; c < 3; ++c)
    for (float& v : image[c].data) v *= factor;
}

inline void scaleVariance(Case& c, float factor) {
  scale(c.estimates.estimates[0].variance, factor);
  for (Checkpoint& k : c.estimates.history["pt"]) scale(k.variance, factor);
}

// All features from one plane, without noise: albedo a (p, 2p, 3p) / 3, normal a p + b, depth 1 + 3p, visibility p.
template <class Get>
void collinearFeatures(Case& c, const Get& value) {
  Features& f = *c.estimates.features;
  for (size_t i = 0; i < c.truth.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const float p = value(i), scaled = p * static_cast<float>(k + 1) / 3;
      for (Plane<float>* to : {&f.albedo.mean[k], &f.albedo.half[0][k], &f.albedo.half[1][k]}) (*to)[i] = scaled;
      for (Plane<float>* to : {&f.normal.mean[k], &f.normal.half[0][k], &f.normal.half[1][k]}) (*to)[i] = 2 * p - 1;
      f.albedo.variance[k][i] = f.normal.variance[k][i] = 0;
    }
    for (Plane<float>* to : {&f.depth.mean, &f.depth.half[0], &f.depth.half[1]}) (*to)[i] = 1 + 3 * value(i);
    for (Plane<float>* to : {&f.visibility.mean, &f.visibility.half[0], &f.visibility.half[1]}) (*to)[i] = value(i);
    f.depth.variance[i] = f.visibility.variance[i] = 0;
  }
}

inline void equalHalves(Estimate& e) {
  e.half[0] = e.half[1] = e.mean;
  for (Rgb<float>& q : e.quarter) q = e.mean;
}

// Writes `value` over a block of 5 x 4 pixels of every plane of an estimate.
inline void island(Estimate& e, int x0, int y0, float value) {
  const auto fill = [&](Rgb<float>& image) {
    if (image.empty()) return;
    for (Plane<float>& p : image.channel)
      for (int y = y0; y < std::min(p.height, y0 + 4); ++y)
        for (int x = x0; x < std::min(p.width, x0 + 5); ++x) p.at(x, y) = value;
  };
  for (Rgb<float>* image :
       {&e.mean, &e.half[0], &e.half[1], &e.variance, &e.bias, &e.biasHalf[0], &e.biasHalf[1], &e.biasVariance})
    fill(*image);
  for (Rgb<float>& q : e.quarter) fill(q);
}

inline Case withIslands(Case c, float value) {
  int x = 2;
  for (Estimate& e : c.estimates.estimates) island(e, x, 3, value), x += 6;
  for (Estimate& e : c.denoised) island(e, 2, 3, value);
  for (Checkpoint& k : c.estimates.history["pt"]) k.variance.set(k.variance[0].index(3, 4), Vec3(value));
  Features& f = *c.estimates.features;
  for (int k = 0; k < 6; ++k) {
    const size_t i = f.depth.mean.index(8 + k, 12);
    f.albedo.mean.set(i, Vec3(value));
    f.normal.half[0].set(i, Vec3(value));
    f.depth.mean[i] = f.visibility.variance[i] = value;
  }
  return c;
}

}  // namespace detail

}  // namespace braid::test
