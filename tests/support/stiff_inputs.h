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
#include <string>
#include <utility>
#include <vector>

#include "combiners/pipeline/exposure.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/every_method.h"
#include "tests/support/stiff_planes.h"

namespace braid::test {

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

namespace detail {

// Cases made from a usual one.
class StiffList {
 public:
  std::vector<StiffCase> cases;
  const Case usual = makeCase(stiffOptions());
  const size_t centre = usual.truth[0].index(12, 8);

  void add(const std::string& name, Case c) { cases.push_back({name, std::move(c)}); }
  void addOptions(const std::string& name, const std::function<void(CaseOptions&)>& change) {
    CaseOptions o = stiffOptions();
    change(o);
    add(name, makeCase(o));
  }
  void addChanged(const std::string& name, const std::function<void(Case&)>& change) {
    Case c = usual;
    change(c);
    add(name, std::move(c));
  }
  // Other samples of X.
  void addSamples(const std::string& name, const StiffSample& sample) {
    addChanged(name, [&](Case& c) { resample(c, 0, sample); });
  }
};

inline double exponential(double truth, double u) { return -truth * std::log(u); }

inline void addStiffNoise(StiffList& list) {
  const auto silent = [](CaseOptions& o) { o.noise = o.correlatedNoise = o.photonNoise = 0; };
  list.addOptions("constant", [&](CaseOptions& o) { silent(o), o.constant = 0.7; });
  list.addOptions("zero variance", silent);
  list.addOptions("all black", [](CaseOptions& o) { o.light = 0; });
  list.addSamples("one firefly of 10^6", [&](uint64_t pass, size_t i, double truth, double u) {
    return pass == 5 && i == list.centre ? 1e6 : exponential(truth, u);
  });
  list.addChanged("Pareto 1.5", [](Case& c) {
    const StiffSample heavy = [](uint64_t, size_t, double truth, double u) { return truth * pareto(u); };
    resample(c, 0, heavy);
    resample(c, 2, heavy);
  });
}

inline void addStiffFeatures(StiffList& list) {
  list.addChanged("collinear features", [](Case& c) {
    const Rgb<float> albedo = c.estimates.features->albedo.mean;
    collinearFeatures(c, [&](size_t i) { return albedo[0][i]; });
  });
  list.addChanged("features collinear with Y", [](Case& c) {
    const Rgb<float> y = c.sppm().mean;
    collinearFeatures(c, [&](size_t i) { return y[0][i]; });
  });
  list.addChanged("constant features", [](Case& c) { collinearFeatures(c, [](size_t) { return 0.5f; }); });
}

inline void addStiffVariances(StiffList& list) {
  list.addChanged("variance / 100", [](Case& c) { scaleVariance(c, 0.01f); });
  list.cases.back().varianceFactor = 0.01;
  list.addChanged("variance x 100", [](Case& c) { scaleVariance(c, 100); });
  list.cases.back().varianceFactor = 100;
  list.addChanged("noise with variance 0", [](Case& c) { scaleVariance(c, 0); });
  list.addChanged("halves equal", [](Case& c) {
    for (Estimate& e : c.estimates.estimates) equalHalves(e);
    refilter(c);
  });
}

inline void addStiffValues(StiffList& list) {
  constexpr double kMost = static_cast<double>(std::numeric_limits<float>::max());
  list.addOptions("denormals", [](CaseOptions& o) { o.light = 1e-40; });
  list.addSamples("some pixels near 65504", [](uint64_t, size_t i, double truth, double u) {
    return i % 7 == 3 ? 65504 * (1 - 0.1 * u) : exponential(truth, u);
  });
  list.addOptions("all near 65504", [](CaseOptions& o) { o.light = 65504; });
  // Samples near FLT_MAX are not of the truth, and their variances are beyond floats: infinite, and taken for 0.
  list.addSamples("samples of FLT_MAX", [&](uint64_t pass, size_t i, double truth, double u) {
    return i == list.centre || (i % 29 == 5 && pass == 3) ? kMost : exponential(truth, u);
  });
  list.cases.back().honest = false;
  list.addSamples("all near FLT_MAX", [](uint64_t, size_t, double truth, double u) {
    return kMost * (1 - 0.2 * u) * std::min(1.0, 0.5 + truth);
  });
  list.cases.back().honest = false;
  list.addSamples("negative pixels", [](uint64_t, size_t i, double truth, double u) {
    return (i % 24 < 4 ? -0.5 : truth) + 4 * truth * std::sqrt(3.0) * (2 * u - 1);
  });
  list.add("NaN islands", withIslands(list.usual, std::nanf("")));
  list.add("infinite islands", withIslands(list.usual, std::numeric_limits<float>::infinity()));
  list.addChanged("all NaN", [](Case& c) {
    for (Estimate& e : c.estimates.estimates)
      for (int y = 0; y < 16; y += 4)
        for (int x = 0; x < 24; x += 5) island(e, x, y, std::nanf(""));
    refilter(c);
  });
}

}  // namespace detail

// Inputs whose values, variances, halves or features are stiff, and those whose Y is.
inline std::vector<StiffCase> stiffCases() {
  detail::StiffList list;
  detail::addStiffNoise(list);
  detail::addStiffFeatures(list);
  detail::addStiffVariances(list);
  detail::addStiffValues(list);
  for (StiffCase& s : stiffBiasedCases()) list.cases.push_back(std::move(s));
  return std::move(list.cases);
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
