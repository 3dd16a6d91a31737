// SPDX-License-Identifier: Apache-2.0
// What js-neural and double-shrinkage-neural make of what a network says, whatever that is: with even weights the
// methods without one, by the formulas, and never more error than the unbiased image.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/learned/network_place.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pixels/mirror.h"
#include "combiners/statistics/half_statistics.h"
#include "renderer/core/error.h"
#include "tests/combiners/learned/network_writer.h"
#include "tests/combiners/learned/plain_network.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test_neural_shrinkage {

using namespace test;

namespace {

constexpr int kJsInputs = 12, kErrorInputs = 11, kCells = 25;

// The network of a method for as long as this lives.
class NamedNetwork {
 public:
  NamedNetwork(const std::string& method, int inputs, const std::vector<float>& bias, float weight = 0,
               uint64_t seed = 0)
      : method_(method) {
    const std::string path = (folder_.path / "some.network").string();
    writePixelNetwork(path, inputs, bias, [&](int o, int i) {
      return weight * (2 * noiseAt(seed, static_cast<uint64_t>(100 * o + i)) - 1);
    });
    nameNetwork(method, path);
  }
  ~NamedNetwork() { nameNetwork(method_, ""); }
  NamedNetwork(const NamedNetwork&) = delete;
  NamedNetwork& operator=(const NamedNetwork&) = delete;

 private:
  Folder folder_;
  std::string method_;
};

std::vector<float> jsBias(float blend) {
  std::vector<float> bias(kCells + 1, 1.0f);
  bias.back() = blend;
  return bias;
}

std::vector<float> errorBias(float prior) {
  std::vector<float> bias(2 * kCells + 1, 0.0f);
  bias.back() = prior;
  return bias;
}

MethodResult resultOf(const char* method, MethodInputs in, const std::map<std::string, double>& options = {}) {
  for (const auto& [name, value] : options) in.options.set(name, value);
  return findMethod(method)->run(in);
}

const Plane<float>& planeOf(const MethodResult& r, const std::string& name) {
  for (const NamedPlane& p : r.aovs)
    if (p.name == name) return p.plane;
  FAIL("no plane " << name);
  std::abort();
}

double distance(const Rgb<float>& a, const Rgb<float>& b) {
  return std::sqrt(meanSquaredError(a, b) / meanSquaredError(b, Rgb<float>(b.width(), b.height())));
}

}  // namespace

TEST_CASE("js-neural with even weights and even blend is js") {
  if (!oneDnn()) return;
  const NamedNetwork network("js-neural", kJsInputs, jsBias(0));
  for (const char* biased : {"sppm", "narrow"})
    for (const double fireflies : {0.0, 1e-3}) {
      CaseOptions options = sized(61, 44, 16);
      options.fireflies = fireflies;
      const Case c = makeCase(options);
      const MethodResult learned = resultOf("js-neural", inputsOf(c, biased)),
                         plain = resultOf("js", inputsOf(c, biased));
      CHECK(distance(learned.image.mean, plain.image.mean) < 1e-6);
      CHECK(distance(learned.image.half[1], plain.image.half[1]) < 1e-6);
    }
}

TEST_CASE("js-neural takes as much of either fit as the network says") {
  if (!oneDnn()) return;
  const Case c = makeCase(sized(48, 40, 8));
  const auto image = [&](float blend) {
    const NamedNetwork network("js-neural", kJsInputs, jsBias(blend));
    return resultOf("js-neural", inputsOf(c), {{"js-constant", 0}, {"js-regression", 1}, {"js-gate", 0}}).image.mean;
  };
  const auto shrunk = [&](float blend) {
    const NamedNetwork network("js-neural", kJsInputs, jsBias(blend));
    return resultOf("js-neural", inputsOf(c), {{"js-constant", 100}, {"js-regression", 1}, {"js-measured", 0}})
        .image.mean;
  };
  // All X: no fit counts. All Y*: that of alpha = 1/2 is the mean of both.
  CHECK(distance(image(-30), image(30)) < 1e-6);
  const Rgb<float> a = shrunk(30), b = shrunk(-30), half = shrunk(0);
  CHECK(distance(a, b) > 1e-3);
  CHECK(distance(average(a, b), half) < 0.1 * distance(a, b));  // negative values are cut
}

TEST_CASE(
    "js-neural and double-shrinkage-neural have no more error than the unbiased image, whatever the network says") {
  if (!oneDnn()) return;
  for (const char* biased : {"sppm", "narrow", "wide"})
    for (const uint64_t samples : {8u, 64u}) {
      double x = 0, js = 0, both = 0;
      for (uint64_t seed = 1; seed <= 4; ++seed) {
        CaseOptions options = sized(56, 48, samples);
        options.seed = seed;
        const Case c = makeCase(options);
        const NamedNetwork one("js-neural", kJsInputs, jsBias(0), 4, seed);
        const NamedNetwork other("double-shrinkage-neural", kErrorInputs, errorBias(-20), 4, seed);
        const MethodInputs in = inputsOf(c, biased);
        x += meanSquaredError(in.unbiased->mean, c.truth);
        js += meanSquaredError(resultOf("js-neural", in).image.mean, c.truth);
        both += meanSquaredError(resultOf("double-shrinkage-neural", in).image.mean, c.truth);
      }
      CAPTURE(std::string(biased));
      CAPTURE(samples);
      CHECK(js < x);
      CHECK(both < x);
    }
}

TEST_CASE("js-neural and double-shrinkage-neural converge, whatever the network says") {
  if (!oneDnn()) return;
  const NamedNetwork one("js-neural", kJsInputs, jsBias(0), 4, 7);
  const NamedNetwork other("double-shrinkage-neural", kErrorInputs, errorBias(0), 4, 7);
  for (const char* method : {"js-neural", "double-shrinkage-neural"}) {
    CAPTURE(std::string(method));
    double last = HUGE_VAL;
    for (const uint64_t samples : {16u, 256u, 4096u}) {
      CaseOptions options = sized(40, 32, samples);
      options.noise = 0.7;
      const Case c = makeCase(options);
      const double error = meanSquaredError(resultOf(method, inputsOf(c, "wide")).image.mean, c.truth);
      CHECK(error < 0.5 * last);
      last = error;
    }
  }
}

TEST_CASE(
    "double-shrinkage-neural with even weights: box means of what pixels say, and the formula of the three weights") {
  if (!oneDnn()) return;
  const Case c = makeCase(sized(40, 33, 16));
  const NamedNetwork network("double-shrinkage-neural", kErrorInputs, errorBias(-3));
  const MethodResult r = resultOf("double-shrinkage-neural", inputsOf(c),
                                  {{"double-shrinkage-neural-limit", 0},
                                   {"double-shrinkage-gate", 0},
                                   {"double-shrinkage-debias", 0},
                                   {"double-shrinkage-remove-fireflies", 0},
                                   {"double-shrinkage-measured", 0},
                                   {"double-shrinkage-chosen", 0}});
  const std::string of = ".double-shrinkage-neural";
  const Plane<float>&u = planeOf(r, "error-unbiased" + of), &b = planeOf(r, "error-biased" + of),
        &p = planeOf(r, "eta2" + of), &k1 = planeOf(r, "kappa1" + of), &k2 = planeOf(r, "kappa2" + of);
  const Rgb<float> variance = meanVariance(c.pt());
  Plane<float> mean(variance.width(), variance.height());
  for (size_t i = 0; i < mean.size(); ++i) mean[i] = (variance[0][i] + variance[1][i] + variance[2][i]) / 3;
  const Plane<double> box = mirrorBoxMean(mean, 6);
  for (size_t i = 0; i < mean.size(); ++i) {
    double level = 0;
    for (size_t k = 0; k < 3; ++k)
      level += static_cast<double>(planeOf(r, std::string("prior") + of + "." + "RGB"[k])[i]) / 3;
    const auto eu = static_cast<double>(u[i]), eb = static_cast<double>(b[i]), ep = static_cast<double>(p[i]);
    CHECK(eu == doctest::Approx(box[i]).epsilon(1e-4));
    CHECK(ep == doctest::Approx(std::exp(-3.0) * (level * level + 0.01)).epsilon(1e-3));
    CHECK(static_cast<double>(k1[i]) == doctest::Approx(eu / (eu + eb)).epsilon(1e-4));
    const double h = eu * eb / (eu + eb);
    CHECK(static_cast<double>(k2[i]) == doctest::Approx(h / (h + ep)).epsilon(1e-4));
    for (size_t k = 0; k < 3; ++k) {
      const auto x = static_cast<double>(c.pt().mean[k][i]), y = static_cast<double>(c.sppm().mean[k][i]);
      const auto prior = static_cast<double>(planeOf(r, std::string("prior") + of + "." + "RGB"[k])[i]);
      const double first = std::max(0.0, x + static_cast<double>(k1[i]) * (y - x));
      const double out = std::max(0.0, first + static_cast<double>(k2[i]) * (prior - first));
      CHECK(static_cast<double>(r.image.mean[k][i]) == doctest::Approx(out).epsilon(1e-4));
    }
  }
}

TEST_CASE("A file that is no network of the method is refused in one line that names it") {
  if (!oneDnn()) return;
  const Case c = makeCase(sized(16, 12, 8));
  const auto message = [&](const char* method, int inputs, size_t outputs) {
    const NamedNetwork network(method, inputs, std::vector<float>(outputs, 0.0f));
    try {
      resultOf(method, inputsOf(c));
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("it ran");
  };
  CHECK(message("js-neural", 11, 26).find("train it again") != std::string::npos);
  CHECK(message("js-neural", kJsInputs, 27).find("27 numbers a pixel are not 1 square windows") != std::string::npos);
  CHECK(message("double-shrinkage-neural", kErrorInputs, 26).find("some.network: 26 numbers") != std::string::npos);
  CHECK(message("js-neural", kJsInputs, 26) == "it ran");
}

}  // namespace braid::test_neural_shrinkage
