// SPDX-License-Identifier: Apache-2.0
// The film on stiff samples, against exact integer arithmetic: ten million passes of many scales, and small images of
// constants, fireflies, heavy tails, both ends of floats, negative values and islands of values that are none.
// Nothing here is statistical: references are exact, so a correct film never fails.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "renderer/core/hash.h"
#include "renderer/core/moments.h"
#include "renderer/film/film.h"
#include "tests/film/exact_sums.h"

namespace braid::test_stiff_film {

using test::exact_sums::ExactSums;

namespace {

constexpr float kMost = std::numeric_limits<float>::max();

// A stream of pass values. `bits` as in ExactSums.
struct Stream {
  const char* name;
  int bits;
  std::function<float(uint64_t pass, uint32_t u)> value;  // of 24 random bits
  bool varianceFitsFloat = true;
};

double unit(uint32_t u) { return (u + 0.5) * 0x1p-24; }

// 1 + deviation times a uniform variate of deviation 1: a pixel of that relative noise.
float aroundOne(uint32_t u, double deviation) {
  return static_cast<float>(1 + deviation * std::sqrt(12.0) * (unit(u) - 0.5));
}

std::vector<Stream> streams() {
  std::vector<Stream> list;
  list.push_back({"uniform", 24, [](uint64_t, uint32_t u) { return static_cast<float>(u) * 0x1p-24f; }});
  list.push_back({"Pareto 1.5", 23, [](uint64_t, uint32_t u) {
                    return static_cast<float>(std::min(0x1p20, std::pow(unit(u), -1 / 1.5)));
                  }});
  list.push_back({"one firefly of 10^6", 24, [](uint64_t pass, uint32_t u) {
                    return pass == 7'654'321 ? 1e6f : static_cast<float>(u) * 0x1p-24f;
                  }});
  list.push_back({"rare light", 0, [](uint64_t, uint32_t u) { return u < 1678 ? 1000.0f : 0.0f; }});
  list.push_back({"near 65504", 8, [](uint64_t, uint32_t u) { return 65504 - static_cast<float>(u >> 8) * 0x1p-4f; }});
  list.push_back({"up to FLT_MAX", -104, [](uint64_t, uint32_t u) { return static_cast<float>(u) * 0x1p104f; }, false});
  list.push_back(
      {"denormals", 149, [](uint64_t, uint32_t u) { return static_cast<float>(u >> 1) * 0x1p-149f; }, false});
  list.push_back(
      {"either sign", 23, [](uint64_t, uint32_t u) { return (static_cast<float>(u) - 0x1p23f) * 0x1p-23f; }});
  list.push_back({"deviation 10^-1", 24, [](uint64_t, uint32_t u) { return aroundOne(u, 1e-1); }});
  list.push_back({"deviation 10^-2", 24, [](uint64_t, uint32_t u) { return aroundOne(u, 1e-2); }});
  list.push_back({"deviation 10^-3", 24, [](uint64_t, uint32_t u) { return aroundOne(u, 1e-3); }});
  return list;
}

double relativeError(double value, long double exact) {
  return static_cast<double>(std::fabs(static_cast<long double>(value) - exact) / std::fabs(exact));
}

// One film of `streams` pixels that has seen all passes, from one whose pixel (s, p) has seen part p of stream s.
Accumulator merged(const Accumulator& parts, int streamCount, int partCount) {
  Accumulator all(streamCount, 1, parts.bucketCount());
  for (int p = 0; p < partCount; ++p) {
    const auto cut = [&](const Rgb<double>& in) {
      Rgb<double> out(streamCount, 1);
      for (size_t c = 0; c < 3; ++c)
        for (int s = 0; s < streamCount; ++s) out[c].at(s, 0) = in[c].at(s * partCount + p, 0);
      return out;
    };
    std::vector<Rgb<double>> sums;
    std::vector<uint64_t> counts;
    for (size_t k = 0; k < parts.sums().size(); ++k) {
      sums.push_back(cut(parts.sums()[k]));
      counts.push_back(parts.passesInBucket(static_cast<int>(k)));
    }
    Accumulator more = Accumulator::fromSums(std::move(sums), cut(parts.sumOfSquares()), std::move(counts), 0, 0);
    RawSums to, from;
    all.listSums("sum", "squares", to);
    more.listSums("sum", "squares", from);
    addSums(to, from);
    all.addCounts(more);
  }
  return all;
}

// What a film of one pixel would hold after the passes, summed without a pause, as Accumulator::commit() does it.
struct RunningSums {
  double bucket[2] = {0, 0}, squares = 0;
  void add(uint64_t pass, float v) {
    const auto d = static_cast<double>(v);
    bucket[pass % 2] += d;
    squares += d * d;
  }
};

constexpr int kWidth = 13, kHeight = 9;
constexpr uint64_t kPassCount = 64;

float randomUnit(uint64_t pass, size_t pixel) { return static_cast<float>(hashCombine(pass, pixel) >> 40) * 0x1p-24f; }

// The pass values of an image, all channels equal.
struct StiffPasses {
  const char* name;
  std::function<float(uint64_t pass, size_t pixel)> value;
};

std::vector<StiffPasses> stiffPasses() {
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  std::vector<StiffPasses> list;
  for (const float v : {0.0f, 0.1f, 1.0f / 3, -0.7f, 65504.0f, kMost, -kMost, 1e-45f, 1.1754942e-38f})
    list.push_back({"constant", [v](uint64_t, size_t) { return v; }});
  list.push_back({"constant per pixel", [](uint64_t, size_t i) { return std::sqrt(static_cast<float>(i)); }});
  list.push_back({"one firefly of 10^6",
                  [](uint64_t pass, size_t i) { return pass == 17 && i == 40 ? 1e6f : randomUnit(pass, i); }});
  list.push_back(
      {"Pareto 1.5", [](uint64_t pass, size_t i) { return std::pow(randomUnit(pass, i) + 0x1p-25f, -1 / 1.5f); }});
  list.push_back({"denormals", [](uint64_t pass, size_t i) { return 1e-38f * randomUnit(pass, i); }});
  list.push_back({"near 65504", [](uint64_t pass, size_t i) { return 65504 - 32 * randomUnit(pass, i); }});
  list.push_back({"one sample of FLT_MAX",
                  [](uint64_t pass, size_t i) { return pass == 3 && i % 5 == 2 ? kMost : randomUnit(pass, i); }});
  list.push_back({"up to FLT_MAX", [](uint64_t pass, size_t i) { return kMost * randomUnit(pass, i); }});
  list.push_back({"either end", [](uint64_t pass, size_t i) { return pass % 2 == i % 2 ? kMost : -kMost; }});
  list.push_back({"negative", [](uint64_t pass, size_t i) { return -100 * randomUnit(pass, i); }});
  list.push_back({"NaN islands", [nan](uint64_t pass, size_t i) {
                    return i % kWidth < 4 && i < 4 * kWidth ? nan : randomUnit(pass, i);
                  }});
  list.push_back({"now and then infinite", [infinity](uint64_t pass, size_t i) {
                    return (pass + i) % 7 == 0 ? (i % 2 ? infinity : -infinity) : randomUnit(pass, i);
                  }});
  return list;
}

// The passes of a pixel, in two steps and long double: exact to 10^-17.
struct PixelStatistics {
  std::vector<float> values;
  void add(float v) { values.push_back(v); }
  float least() const { return *std::min_element(values.begin(), values.end()); }
  float most() const { return *std::max_element(values.begin(), values.end()); }
  long double mean() const {
    long double sum = 0;
    for (const float v : values) sum += static_cast<long double>(v);
    return sum / static_cast<long double>(values.size());
  }
  long double varianceOfMean() const {
    const long double m = mean(), n = static_cast<long double>(values.size());
    long double sum = 0;
    for (const float v : values) sum += (static_cast<long double>(v) - m) * (static_cast<long double>(v) - m);
    return sum / (n * (n - 1));
  }
};

// The first pixel whose value is not between the smallest and the largest of its passes; "" if there is none.
std::string beyondRange(const Rgb<float>& image, const std::vector<PixelStatistics>& expected) {
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < expected.size(); ++i)
      if (!(image[c][i] >= expected[i].least() && image[c][i] <= expected[i].most()))
        return std::to_string(image[c][i]) + " at " + std::to_string(i);
  return {};
}

// The first variance that is not the exact one to 10^-6; "" if there is none. Variances beyond the range of floats are
// the largest float, and those that rounding alone can make are zero (renderer/core/moments.h).
std::string wrongVariance(const Rgb<float>& variance, const std::vector<PixelStatistics>& expected) {
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < expected.size(); ++i) {
      const long double exact = std::min(expected[i].varianceOfMean(), static_cast<long double>(kMost));
      const long double m = expected[i].mean(), rounding = 0x1p-53L * m * m * 64 / 63 + 2e-45L;
      const long double v = static_cast<long double>(variance[c][i]);
      if (!(std::isfinite(variance[c][i]) && std::fabs(v - exact) <= 1e-6L * exact + rounding))
        return std::to_string(variance[c][i]) + " instead of " + std::to_string(exact) + " at " + std::to_string(i);
    }
  return {};
}

bool finiteVariance(const Rgb<float>& image) {
  for (const Plane<float>& p : image.channel)
    for (const float v : p.data)
      if (!(std::isfinite(v) && v >= 0)) return false;
  return true;
}

}  // namespace

TEST_CASE("After ten million stiff passes means and variances have a relative error below 10^-6") {
  constexpr int kParts = 20;
  constexpr uint64_t kPasses = 10'000'000, kPerPart = kPasses / kParts;
  const std::vector<Stream> list = streams();
  const int count = static_cast<int>(list.size());
  Accumulator parts(count * kParts, 1, 2);
  PassTarget target(count * kParts, 1, {});
  std::vector<ExactSums> exact;
  for (const Stream& s : list) exact.emplace_back(s.bits);
  std::vector<RunningSums> running(list.size());
  for (uint64_t pass = 0; pass < kPerPart; ++pass) {
    for (int p = 0; p < kParts; ++p) {
      const uint64_t global = static_cast<uint64_t>(p) * kPerPart + pass;
      const auto u = static_cast<uint32_t>(mix64(global + 1) >> 40);
      for (int s = 0; s < count; ++s) {
        const auto at = static_cast<size_t>(s);
        const float v = list[at].value(global, u);
        exact[at].add(v);
        running[at].add(pass, v);
        target.addSigned(s * kParts + p, 0, Spectrum(v));
      }
    }
    parts.commit(pass, target);
  }
  const Accumulator film = merged(parts, count, kParts);
  REQUIRE(film.passes() == kPasses);
  const Rgb<float> mean = film.mean(), variance = film.passVariance();
  for (size_t s = 0; s < list.size(); ++s) {
    CAPTURE(std::string(list[s].name));
    REQUIRE(exact[s].representable());
    const double sum = film.sums()[0][0][s] + film.sums()[1][0][s];
    CHECK(relativeError(sum / static_cast<double>(kPasses), exact[s].mean()) < 1e-6);
    CHECK(relativeError(static_cast<double>(mean[0][s]), exact[s].mean()) < 1e-6);
    CHECK(relativeError(varianceOfMean(sum, film.sumOfSquares()[0][s], kPasses), exact[s].varianceOfMean()) < 1e-6);
    if (list[s].varianceFitsFloat)
      CHECK(relativeError(static_cast<double>(variance[0][s]), exact[s].varianceOfMean()) < 1e-6);
    // Not merged: rounding had twenty times as many additions to grow.
    const double all = running[s].bucket[0] + running[s].bucket[1];
    CHECK(relativeError(all / static_cast<double>(kPasses), exact[s].mean()) < 1e-6);
    CHECK(relativeError(varianceOfMean(all, running[s].squares, kPasses), exact[s].varianceOfMean()) < 1e-6);
  }
}

TEST_CASE("Stiff pass values leave every plane of the film finite, in range, and as exact sums have it") {
  for (const StiffPasses& c : stiffPasses())
    for (const int buckets : {2, 4}) {
      CAPTURE(std::string(c.name));
      CAPTURE(buckets);
      Accumulator film(kWidth, kHeight, buckets);
      PassTarget target(kWidth, kHeight, {});
      std::vector<PixelStatistics> expected(static_cast<size_t>(kWidth * kHeight));
      uint64_t rejected = 0, accepted = 0;
      for (uint64_t pass = 0; pass < kPassCount; ++pass) {
        for (int y = 0; y < kHeight; ++y)
          for (int x = 0; x < kWidth; ++x) {
            const size_t i = static_cast<size_t>(y * kWidth + x);
            const float v = c.value(pass, i);
            rejected += !std::isfinite(v);
            expected[i].add(std::isfinite(v) ? v : 0.0f);
            accepted += target.addSigned(x, y, Spectrum(v));
          }
        film.commit(pass, target);
        target.clear();
      }
      CHECK(film.rejected() == rejected);
      CHECK(accepted == expected.size() * kPassCount - rejected);
      CHECK(beyondRange(film.mean(), expected) == "");
      for (int h = 0; h < 2; ++h) CHECK(beyondRange(film.halfMean(h), expected) == "");
      for (int k = 0; k < buckets; ++k) CHECK(beyondRange(film.bucketMean(k), expected) == "");
      CHECK(wrongVariance(film.passVariance(), expected) == "");
      CHECK(finiteVariance(film.variance(true)));
    }
}

TEST_CASE("Halves that are equal have no variance between them, and the passes keep theirs") {
  Accumulator film(kWidth, kHeight, 2);
  PassTarget target(kWidth, kHeight, {});
  for (uint64_t pass = 0; pass < kPassCount; ++pass) {
    for (int i = 0; i < kWidth * kHeight; ++i)
      target.add(i % kWidth, i / kWidth, Spectrum(randomUnit(pass / 2, static_cast<size_t>(i))));
    film.commit(pass, target);
  }
  const Rgb<float> a = film.halfMean(0), b = film.halfMean(1), between = film.variance(true),
                   within = film.passVariance();
  for (size_t i = 0; i < a.size(); ++i) {
    CHECK(a[0][i] == b[0][i]);
    CHECK(between[0][i] == 0);
    CHECK(within[0][i] > 0);
  }
}

TEST_CASE("Biases, features and coverage of stiff passes stay finite, and constants stay what they are") {
  Accumulator film(kWidth, kHeight, 4, true);
  FeatureAccumulator features(kWidth, kHeight);
  CoverageAccumulator coverage(kWidth, kHeight);
  PassTarget target(kWidth, kHeight, {.features = true, .coverage = true, .bias = true});
  const float nan = std::nanf("");
  for (uint64_t pass = 0; pass < kPassCount; ++pass) {
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const bool island = x < 3 && y < 3;
        FeatureSample sample;
        sample.albedo = island ? Spectrum(0.1f, nan, 0.3f) : Spectrum(0.1f, 0.2f, 0.3f);
        sample.normal = Vec3(0, pass % 2 ? 1.0f : -1.0f, 0);
        sample.depth = x == 5 ? kMost : 1e-41f;
        sample.visibility = 1;
        target.features(x, y, sample);
        target.coverage(x, y, 0.1f);
        target.bias(x, y, island ? Spectrum(nan) : Spectrum(x == 5 ? -kMost : 1e-3f * randomUnit(pass, 7) - 1));
      }
    film.commit(pass, target);
    features.commit(pass, target);
    coverage.commit(target);
    target.clear();
  }
  CHECK(film.rejected() == 2 * 9 * kPassCount);
  for (const Rgb<float>& image : {film.biasMean(), film.biasHalfMean(0), film.biasHalfMean(1), film.biasVariance()})
    for (size_t c = 0; c < 3; ++c)
      for (const float v : image[c].data) CHECK(std::isfinite(v));
  for (int k = 0; k < static_cast<int>(kFeatureComponents); ++k)
    for (const Plane<float>& plane :
         {features.mean(k), features.halfMean(k, 0), features.halfMean(k, 1), features.variance(k)})
      for (const float v : plane.data) CHECK(std::isfinite(v));
  const size_t outside = static_cast<size_t>(4 * kWidth + 7);
  CHECK(features.mean(0)[outside] == 0.1f);
  CHECK(features.variance(0)[outside] == 0);
  CHECK(features.mean(1)[0] == 0);  // of an island: rejected components count as 0
  CHECK(features.mean(4)[outside] == 0);
  CHECK(features.variance(4)[outside] == doctest::Approx(1.0 / (kPassCount - 1)));
  CHECK(features.mean(6)[outside] == 1e-41f);
  CHECK(features.mean(6)[5] == kMost);
  CHECK(coverage.mean()[outside] == 0.1f);
}

}  // namespace braid::test_stiff_film
