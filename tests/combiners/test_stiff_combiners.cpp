// SPDX-License-Identifier: Apache-2.0
// Every registered denoiser and combiner on stiff inputs (tests/support/stiff_inputs.h): constant, noiseless, black and
// heavy-tailed images, wrong variances, degenerate features, adversarial biased inputs, values at both ends of floats.
// Results are finite, what a formula says is convex lies between its inputs, and factors lie in [0, 1].
#include <algorithm>
#include <cmath>
#include <optional>

#include <doctest/doctest.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/shrinkage/debias.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/combine_plan.h"
#include "tests/support/stiff_inputs.h"

namespace braid::test_stiff_combiners {

using namespace test;

namespace {

// Relative rounding of a quotient of float sums over the 441 pixels of the largest window, Σ w v / Σ w.
constexpr double kRounding = 441 * 0x1p-24 * 2;

bool startsWith(const std::string& text, const char* prefix) { return text.rfind(prefix, 0) == 0; }

double value(const Rgb<float>& image, size_t c, size_t i) { return static_cast<double>(image[c][i]); }

// Weights and shrinkage factors beyond [0, 1], and weights of bases that do not sum to 1.
std::string badFactors(const Method& m, const MethodResult& r) {
  std::string bad;
  Plane<double> sum(r.image.mean.width(), r.image.mean.height());
  size_t weights = 0;
  for (const NamedPlane& p : r.aovs) {
    const bool weight = startsWith(p.name, "weight.");
    if (!weight && !startsWith(p.name, "shrinkage.") && !startsWith(p.name, "kappa")) continue;
    for (const float v : p.plane.data)
      if (!(v >= 0 && v <= 1 + static_cast<float>(kRounding))) {
        bad += p.name + " ";
        break;
      }
    if (!weight) continue;
    ++weights;
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(p.plane[i]);
  }
  if (weights < 2) return bad;
  for (size_t i = 0; i < sum.size(); ++i)
    if (std::fabs(sum[i] - 1) > kRounding) return bad + "sum of weights of " + m.name();
  return bad;
}

// The images of which each pixel and channel of a result is a convex combination.
using Hull = std::vector<const Rgb<float>*>;

// Whether every value lies between the smallest and the largest one of the hull at its pixel and channel, up to
// rounding, which for values of one sign is relative to them and otherwise to the largest. `nonNegative`: the method
// raises negative results to 0.
std::string beyondHull(const Rgb<float>& out, const Hull& hull, bool nonNegative = false) {
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < out.size(); ++i) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (const Rgb<float>* image : hull) {
        low = std::min(low, value(*image, c, i));
        high = std::max(high, value(*image, c, i));
      }
      const double most = std::max(std::fabs(low), std::fabs(high)), tiny = 1e-37;
      const double below = kRounding * (low >= 0 ? low : most) + tiny, above = kRounding * most + tiny;
      if (nonNegative) low = std::max(0.0, low), high = std::max(0.0, high);
      const double v = value(out, c, i);
      if (v < low - below || v > high + above)
        return std::to_string(v) + " at " + std::to_string(i) + " not in [" + std::to_string(low) + ", " +
               std::to_string(high) + "]";
    }
  return {};
}

// Images of the smallest and the largest value of each channel.
struct Range {
  Rgb<float> low, high;
  explicit Range(const Hull& images) : low(images[0]->width(), images[0]->height()), high(low) {
    for (size_t c = 0; c < 3; ++c) {
      float least = HUGE_VALF, most = -HUGE_VALF;
      for (const Rgb<float>* image : images)
        for (const float v : (*image)[c].data) least = std::min(least, v), most = std::max(most, v);
      std::fill(low[c].data.begin(), low[c].data.end(), least);
      std::fill(high[c].data.begin(), high[c].data.end(), most);
    }
  }
};

Hull meansOf(const std::vector<const Estimate*>& estimates) {
  Hull hull;
  for (const Estimate* e : estimates) hull.push_back(&e->mean);
  return hull;
}

Rgb<float> priorOf(const std::string& name, const MethodResult& r) {
  Rgb<float> prior(r.image.mean.width(), r.image.mean.height());
  for (const NamedPlane& p : r.aovs)
    for (size_t c = 0; c < 3; ++c)
      if (p.name == "prior." + name + "." + "RGB"[c]) prior[c] = p.plane;
  return prior;
}

// y + Σ k_i (g_c - g_i) with k_i >= 0, Σ k_i <= 1 and g = z - y: the limits of unbiased differences. They are no hull
// of the inputs, and may be negative. `uncorrelated` mixes in y + w g_c, w in [0, 1].
std::string beyondDifferences(const Rgb<float>& out, const Rgb<float>& y, const Rgb<float>& z) {
  for (size_t c = 0; c < 3; ++c) {
    double least = HUGE_VAL, most = -HUGE_VAL;
    for (size_t i = 0; i < y.size(); ++i) {
      least = std::min(least, value(z, c, i) - value(y, c, i));
      most = std::max(most, value(z, c, i) - value(y, c, i));
    }
    for (size_t i = 0; i < y.size(); ++i) {
      const double g = value(z, c, i) - value(y, c, i), v = value(out, c, i) - value(y, c, i);
      const double rounding = kRounding * std::max({std::fabs(least), std::fabs(most), std::fabs(value(y, c, i))});
      if (v < std::min({0.0, g, g - most}) - rounding || v > std::max({0.0, g, g - least}) + rounding)
        return "change of " + std::to_string(v) + " at " + std::to_string(i);
    }
  }
  return {};
}

// Why the range of a result is known, by method; nothing: it is not. Filters that divide by the albedo are convex in
// the quotient only, so they are run without features.
//   average, ensemble*, one-hot-*      weights of the bases, not negative, of sum 1
//   inverse-variance, easy, curves,
//   ideal                              a share in [0, 1] of X and of Y
//   js, -neural without regression     Y + rho (X - Y), rho in [0, 1]; then not below 0
//   double-shrinkage, -neural          twice a share in [0, 1]: of X, Y, less its told bias or not, and
//                                      the prior (an output); not below 0
//   box, nlm, pw, pw-wide, rdfc        weighted means of pixels of X (rdfc: of its halves)
//   uncorrelated*                      a weighted sum of differences
// No range: nfor, pw1, js with its regression and auto, which holds pw1, extrapolate by slopes.
std::optional<std::string> beyondRange(const std::string& name, const Method& m, const StiffInputs& s) {
  MethodInputs in = s.inputs(m, !startsWith(name, "pw"));
  if (startsWith(name, "js")) in.options.set("js-regression", 0);
  if (name == "double-shrinkage-neural") in.options.set("double-shrinkage-remove-fireflies", 0);  // else of neighbours
  const Estimate &x = s.x(), &y = s.biased(m);
  if (name == "nfor" || name == "pw1" || name == "auto") return {};
  const MethodResult r = m.run(in);
  const Rgb<float>& out = r.image.mean;
  if (name == "average" || startsWith(name, "ensemble") || startsWith(name, "one-hot"))
    return beyondHull(out, meansOf(in.bases));
  if (name == "inverse-variance" || name == "easy" || name == "curves" || name == "ideal")
    return beyondHull(out, {&x.mean, &y.mean});
  if (startsWith(name, "js")) return beyondHull(out, {&x.mean, &y.mean}, true);
  if (startsWith(name, "double-shrinkage")) {
    const Rgb<float> prior = priorOf(name, r);
    const Estimate less = debiased(y);
    return beyondHull(out, {&x.mean, &y.mean, &less.mean, &prior}, true);
  }
  if (startsWith(name, "uncorrelated")) {
    std::string beyond;
    for (size_t h = 0; h < 2; ++h) beyond += beyondDifferences(r.image.half[h], x.half[h], s.correlated().half[h]);
    // The image of cross-weighting is the mean of its halves.
    return name == "uncorrelated-cross" ? beyond : beyond + beyondDifferences(out, x.mean, s.correlated().mean);
  }
  if (name == "box" || name == "nlm" || name == "pw" || name == "pw-wide" || name == "rdfc") {
    const Range range({&x.mean, name == "rdfc" ? &x.half[0] : &x.mean, name == "rdfc" ? &x.half[1] : &x.mean});
    return beyondHull(out, {&range.low, &range.high});
  }
  return {};
}

MethodResult resultOf(const Method& m, const StiffInputs& s) { return m.run(s.inputs(m)); }

// The same by the pipeline, in the units of the input. Methods that run their denoiser again get the box filter.
std::string faultsOfPipeline(const Method& m, const StiffCase& s) {
  Estimates e = s.c.estimates;
  for (const Estimate& d : s.c.denoised) e.estimates.push_back(d);
  e.reference = s.c.truth;
  PipelineOptions options;
  options.roles.bases = {"narrow", "wide", "sppm"};
  std::string name = m.name();
  if (m.needs().biased) name += m.needs().redenoise ? "@box" : "@sppm";
  const PipelineResult result = runPipeline(e, {name}, options);
  const PipelineOutput* out = result.find(name);
  if (!out || !out->ran()) return out ? out->step.skipReason : "no result";
  return badPlanes(out->result);
}

// What is wrong with the results of a method on a case; "" if nothing is.
std::string faults(const Method& m, const StiffCase& c, const StiffInputs& s) {
  const MethodResult r = resultOf(m, s);
  std::string all = badPlanes(r);
  if (r.image.mean.width() != s.x().mean.width() || r.image.mean.height() != s.x().mean.height()) all += "size ";
  all += badFactors(m, r);
  const std::string piped = faultsOfPipeline(m, c);
  if (!piped.empty()) all += "by the pipeline: " + piped;
  const std::optional<std::string> range = beyondRange(m.name(), m, s);
  if (range && !range->empty()) all += "range: " + *range;
  return all;
}

// The counts of a regression in the remarks of a result, and its condition number; nothing if there are none.
std::optional<double> reportedCondition(const MethodResult& r) {
  for (const Attribute& a : r.remarks) {
    const size_t at = a.text.find("condition <= ");
    if (at == std::string::npos) continue;
    for (const char* count : {" models, ", " with a raised ridge", " constant", " pixels by fallback alone"})
      CHECK(a.text.find(count) != std::string::npos);
    return std::stod(a.text.substr(at + 13));
  }
  return {};
}

}  // namespace

TEST_CASE("Stiff inputs leave every method with finite planes, factors in [0, 1] and values in its range") {
  const auto methods = runnableMethods();
  CHECK(methods.size() >= 21);
  for (const StiffCase& c : stiffCases()) {
    CAPTURE(c.name);
    const StiffInputs s(c);
    for (const auto& m : methods) {
      CAPTURE(std::string(m->name()));
      CHECK(faults(*m, c, s) == "");
    }
  }
}

TEST_CASE("What has no variance is believed: shrinkage, inverse errors and curves return X") {
  for (const StiffCase& c : stiffCases()) {
    if (c.name != "zero variance" && c.name != "noise with variance 0" && c.name != "constant") continue;
    CAPTURE(c.name);
    const StiffInputs s(c);
    for (const char* name : {"js", "inverse-variance", "easy", "curves"}) {
      CAPTURE(std::string(name));
      CHECK(identical(resultOf(*findMethod(name), s).image.mean, s.x().mean));
    }
    // Errors have floors of 10^-8 of the squared value, so the prior keeps a share of 10^-2 of its own floor.
    const Rgb<float> out = resultOf(*findMethod("double-shrinkage"), s).image.mean;
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < out.size(); ++i) CHECK(out[k][i] == doctest::Approx(s.x().mean[k][i]).epsilon(0.02));
  }
}

TEST_CASE("Regressions on collinear and constant features report their condition, ridges and fallbacks") {
  for (const StiffCase& c : stiffCases()) {
    if (c.name.find("features") == std::string::npos) continue;
    CAPTURE(c.name);
    const StiffInputs s(c);
    for (const char* name : {"js", "double-shrinkage", "nfor"}) {
      CAPTURE(std::string(name));
      const std::optional<double> condition = reportedCondition(resultOf(*findMethod(name), s));
      REQUIRE(condition);
      CHECK(std::isfinite(*condition));
      CHECK(*condition >= 1);
    }
  }
}

}  // namespace braid::test_stiff_combiners
