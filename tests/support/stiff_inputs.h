// SPDX-License-Identifier: Apache-2.0
// Stiff inputs for denoisers and combiners: synthetic planes with known truth that are as unlike an image with Gaussian
// noise as a render can make them, and the way from such planes to a method's result.
//
// Every case starts from makeCase() (tests/support/combiner_fixture.h): "pt" is X, "sppm" is Y, the bases are two box
// filters of X and Y, "crn" is the correlated image.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "combiners/pipeline/exposure.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/every_method.h"

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

inline CaseOptions stiffOptions(uint64_t seed = 1) {
  CaseOptions o;
  o.width = 24;
  o.height = 16;
  o.samples = 16;
  o.seed = seed;
  return o;
}

// Inputs whose Y is what makes them stiff; X has usual noise.
inline std::vector<StiffCase> stiffBiasedCases(uint64_t seed = 1) {
  using namespace detail;
  const Case c = makeCase(stiffOptions(seed));
  const Rgb<float> black(c.truth.width(), c.truth.height());
  const Estimate zero = noiseless("sppm", black, c.options.samples);
  Estimate far = c.sppm();
  far.mean = shifted(far.mean, 1e6f);
  for (Rgb<float>& half : far.half) half = shifted(half, 1e6f);
  for (Rgb<float>& q : far.quarter) q = shifted(q, 1e6f);
  std::vector<StiffCase> list;
  list.push_back(withBiased("X = Y, no claims", c, c.pt(), Claims::Nothing));
  list.push_back(withBiased("X = Y, claims exactness", c, c.pt(), Claims::Exactness));
  list.push_back(withBiased("Y = 0, no claims", c, zero, Claims::Nothing));
  list.push_back(withBiased("Y = 0, honest", c, zero, Claims::Honest));
  list.push_back(withBiased("Y = 0, claims exactness", c, zero, Claims::Exactness));
  list.push_back(withBiased("Y off by 10^6, no claims", c, far, Claims::Nothing));
  list.push_back(withBiased("Y off by 10^6, honest", c, far, Claims::Honest));
  list.push_back(withBiased("Y off by 10^6, claims exactness", c, far, Claims::Exactness));
  return list;
}

// Inputs whose values, variances, halves or features are stiff.
inline std::vector<StiffCase> stiffCases() {
  using namespace detail;
  const Case usual = makeCase(stiffOptions());
  const size_t centre = usual.truth[0].index(12, 8);
  constexpr double kMost = static_cast<double>(std::numeric_limits<float>::max());
  std::vector<StiffCase> list;
  const auto add = [&list](const std::string& name, Case c) { list.push_back({name, std::move(c)}); };
  const auto from = [](const std::function<void(CaseOptions&)>& change) {
    CaseOptions o = stiffOptions();
    change(o);
    return makeCase(o);
  };
  const auto changed = [&usual](const std::function<void(Case&)>& change) {
    Case c = usual;
    change(c);
    return c;
  };
  const auto silent = [](CaseOptions& o) { o.noise = o.correlatedNoise = o.photonNoise = 0; };
  const auto resampled = [&](const StiffSample& sample) { return changed([&](Case& c) { resample(c, 0, sample); }); };
  const auto exponential = [](double truth, double u) { return -truth * std::log(u); };

  add("constant", from([&](CaseOptions& o) { silent(o), o.constant = 0.7; }));
  add("zero variance", from(silent));
  add("all black", from([](CaseOptions& o) { o.light = 0; }));
  add("one firefly of 10^6", resampled([&](uint64_t pass, size_t i, double truth, double u) {
        return pass == 5 && i == centre ? 1e6 : exponential(truth, u);
      }));
  add("Pareto 1.5", changed([](Case& c) {
        const StiffSample heavy = [](uint64_t, size_t, double truth, double u) { return truth * pareto(u); };
        resample(c, 0, heavy);
        resample(c, 2, heavy);
      }));
  add("collinear features", changed([&](Case& c) {
        const Rgb<float> albedo = c.estimates.features->albedo.mean;
        collinearFeatures(c, [&](size_t i) { return albedo[0][i]; });
      }));
  add("features collinear with Y", changed([](Case& c) {
        const Rgb<float> y = c.sppm().mean;
        collinearFeatures(c, [&](size_t i) { return y[0][i]; });
      }));
  add("constant features", changed([](Case& c) { collinearFeatures(c, [](size_t) { return 0.5f; }); }));
  add("variance / 100", changed([](Case& c) { scaleVariance(c, 0.01f); }));
  add("variance x 100", changed([](Case& c) { scaleVariance(c, 100); }));
  add("noise with variance 0", changed([](Case& c) { scaleVariance(c, 0); }));
  add("halves equal", changed([](Case& c) {
        for (Estimate& e : c.estimates.estimates) equalHalves(e);
        refilter(c);
      }));
  add("denormals", from([](CaseOptions& o) { o.light = 1e-40; }));
  add("some pixels near 65504", resampled([&](uint64_t, size_t i, double truth, double u) {
        return i % 7 == 3 ? 65504 * (1 - 0.1 * u) : exponential(truth, u);
      }));
  add("all near 65504", from([](CaseOptions& o) { o.light = 65504; }));
  add("samples of FLT_MAX", resampled([&](uint64_t pass, size_t i, double truth, double u) {
        return i == centre || (i % 29 == 5 && pass == 3) ? kMost : exponential(truth, u);
      }));
  add("all near FLT_MAX", resampled([&](uint64_t, size_t, double truth, double u) {
        return kMost * (1 - 0.2 * u) * std::min(1.0, 0.5 + truth);
      }));
  add("negative pixels", resampled([&](uint64_t, size_t i, double truth, double u) {
        return (i % 24 < 4 ? -0.5 : truth) + 4 * truth * std::sqrt(3.0) * (2 * u - 1);
      }));
  add("NaN islands", withIslands(usual, std::nanf("")));
  add("infinite islands", withIslands(usual, std::numeric_limits<float>::infinity()));
  add("all NaN", changed([](Case& c) {
        for (Estimate& e : c.estimates.estimates)
          for (int y = 0; y < 16; y += 4)
            for (int x = 0; x < 24; x += 5) island(e, x, y, std::nanf(""));
        refilter(c);
      }));
  for (StiffCase& s : list) {
    if (s.name == "variance / 100") s.varianceFactor = 0.01;
    if (s.name == "variance x 100") s.varianceFactor = 100;
    // Their samples are not of the truth, and their variances are beyond floats: infinite, and taken for 0.
    if (s.name.find("FLT_MAX") != std::string::npos) s.honest = false;
  }
  for (StiffCase& s : stiffBiasedCases()) list.push_back(std::move(s));
  return list;
}

// A case as methods see it: sanitised, exposure-normalised and limited, as the pipeline does it.
class StiffInputs {
 public:
  explicit StiffInputs(const StiffCase& s) : all_(s.c.estimates), replaces_(s.replacesBiased) {
    for (const Estimate& d : s.c.denoised) all_.estimates.push_back(d);
    all_.reference = s.c.truth;
    exposure_ = exposureScale(all_.find("pt")->mean);
    SanitiseReport report;
    all_ = normalised(all_, exposure_, report);
  }
  StiffInputs(const StiffInputs&) = delete;
  StiffInputs& operator=(const StiffInputs&) = delete;

  double exposure() const { return exposure_; }
  // Mean over pixels and channels of the squared difference of a result from the truth.
  double squaredError(const Rgb<float>& image, const Rgb<float>& truth) const {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = 0; i < truth.size(); ++i)
        sum += sqr(static_cast<double>(image[c][i]) - exposure_ * static_cast<double>(truth[c][i]));
    return sum / static_cast<double>(3 * truth.size());
  }
  const Estimate& x() const { return *all_.find("pt"); }
  const Estimate& correlated() const { return *all_.find("crn"); }
  const Estimate& biased(const Method& m) const {
    return *all_.find(m.needs().redenoise && !replaces_ ? "wide" : "sppm");
  }
  std::vector<const Estimate*> bases() const { return {all_.find("narrow"), all_.find("wide"), all_.find("sppm")}; }

  MethodInputs inputs(const Method& m, bool features = true) const {
    MethodInputs in;
    in.unbiased = &x();
    in.biased = &biased(m);
    in.bases = bases();
    if (std::string(m.name()) == "auto")
      in.bases = {all_.find("sppm")};  // as the combine plan does without named denoisers
    in.correlated = &correlated();
    in.features = features && all_.features ? &*all_.features : nullptr;
    in.reference = &all_.reference;
    in.history = &all_.history.at("pt");
    in.seed = all_.seed;
    const Estimate* y = in.biased;
    if (y->name == "wide")
      in.redenoise = [](const Rgb<float>& image) { return detail::boxFilter(image, 4); };
    else
      in.redenoise = [y](const Rgb<float>&) { return y->mean; };
    return in;
  }

 private:
  Estimates all_;
  bool replaces_;
  double exposure_ = 1;
};

}  // namespace braid::test
