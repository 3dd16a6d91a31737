// SPDX-License-Identifier: Apache-2.0
// The patch-Welch filter: its formula against a plain double-precision transcription, and what it promises.
#include <array>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/denoise/pw/pw_method.h"
#include "combiners/statistics/variance.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/plain_window.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace braid::test_pw {

using namespace test;

namespace {

constexpr std::array kThresholds = {kPatchWelchThreshold, kPatchWelchWideThreshold};

const Features& featuresOf(const Case& c) { return *c.estimates.features; }

std::vector<Rgb<float>> filtered(const Estimate& e, const Features* features, double z = kPatchWelchThreshold) {
  return patchWelch(patchWelchInput(e, features), std::array{z})[0];
}

// An image of known means and variances without features or halves; 16 passes.
Estimate plainEstimate(const Rgb<float>& mean, float variance) {
  Estimate e;
  e.passes = 16;
  e.mean = mean;
  e.variance = Rgb<float>(mean.width(), mean.height(), variance);
  return e;
}

// One pixel of the filter in double, straight from the formula.
class PlainFilter {
 public:
  PlainFilter(const PatchWelchInput& input, size_t image, double z, const PatchWelchNeighbours& neighbours = {})
      : input_(input), image_(image), neighbours_(neighbours) {
    t2_ = sqr(studentQuantile(z, 2 * input.passes - 2));
  }

  Vec3 at(int x, int y) const {
    double total = 0, sum[3] = {0, 0, 0};
    for (int v = std::max(0, y - 9); v <= std::min(input_.height() - 1, y + 9); ++v)
      for (int u = std::max(0, x - 9); u <= std::min(input_.width() - 1, x + 9); ++u) {
        if (!inPlainWindow(u - x, v - y, neighbours_.inner, neighbours_.outer)) continue;
        const double w = weight(x, y, u, v);
        total += w;
        for (size_t c = 0; c < 3; ++c) sum[c] += w * radiance(u, v, c);
      }
    Vec3 out;
    for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(divisor(x, y, static_cast<size_t>(c)) * sum[c] / total);
    return out;
  }

  // Of the pair (x, y), (u, v).
  double weight(int x, int y, int u, int v) const {
    double s = 0, count = 0;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        if (!inside(x + i, y + j) || !inside(u + i, v + j)) continue;
        for (size_t c = 0; c < 3; ++c)
          s += sqr(radiance(x + i, y + j, c) - radiance(u + i, v + j, c)) /
               (variance(x + i, y + j, c) + variance(u + i, v + j, c) + 1e-30);
        count += 3;
      }
    const double rest = std::max(0.0, 1 - s / count / t2_);
    double exponent = (sqr(x - u) + sqr(y - v)) / 50.0;
    if (const Features* f = input_.features) {
      if ((f->depth.mean.at(x, y) == 0) != (f->depth.mean.at(u, v) == 0)) return 0;
      for (size_t c = 0; c < 3; ++c) {
        const auto clamped = [](float a) { return std::clamp(static_cast<double>(a), 0.0, 1.0); };
        exponent += sqr(clamped(f->albedo.mean[c].at(x, y)) - clamped(f->albedo.mean[c].at(u, v))) * 8;
        exponent +=
            sqr(static_cast<double>(f->normal.mean[c].at(x, y)) - static_cast<double>(f->normal.mean[c].at(u, v))) * 8;
      }
    }
    return rest * rest * std::exp(-exponent);
  }

 private:
  double divisor(int x, int y, size_t c) const {
    const Features* f = input_.features;
    if (!f || f->depth.mean.at(x, y) == 0) return 1;
    const Vec3 albedo = f->albedo.mean.pixel(f->albedo.mean[0].index(x, y));
    return maxComponent(albedo) > 1 ? 1 : std::max(static_cast<double>(albedo[static_cast<int>(c)]), 0.03);
  }
  double radiance(int x, int y, size_t c) const {
    return static_cast<double>((*input_.images[image_])[c].at(x, y)) / divisor(x, y, c);
  }
  double variance(int x, int y, size_t c) const {
    return (image_ == 0 ? 1 : 2) * static_cast<double>(input_.variance[c].at(x, y)) / sqr(divisor(x, y, c));
  }
  bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < input_.width() && y < input_.height(); }

  const PatchWelchInput& input_;
  size_t image_;
  PatchWelchNeighbours neighbours_;
  double t2_;
};

// The largest relative error of an image against the plain filter, over every `step`-th pixel.
double worstDifference(const Rgb<float>& image, const PlainFilter& plain, int step) {
  double worst = 0;
  for (int y = 0; y < image.height(); y += step)
    for (int x = 0; x < image.width(); x += step) {
      const Vec3 expected = plain.at(x, y), got = image.pixel(image[0].index(x, y));
      for (int c = 0; c < 3; ++c)
        worst = std::max(worst, static_cast<double>(std::fabs(got[c] - expected[c]) / (expected[c] + 1e-3f)));
    }
  return worst;
}

Rgb<float> halfPlanes(int width, int height, float left, float right) {
  Rgb<float> image(width, height, left);
  for (size_t c = 0; c < 3; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = width / 2; x < width; ++x) image[c].at(x, y) = right;
  return image;
}

double largestDifference(const Rgb<float>& a, const Rgb<float>& b) {
  double worst = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < a.size(); ++i) worst = std::max(worst, static_cast<double>(std::fabs(a[c][i] - b[c][i])));
  return worst;
}

}  // namespace

TEST_CASE("exp2NonPositive is accurate, exact at zero, and never zero or not-a-number") {
  double worst = 0;
  for (int i = 0; i < 126000; ++i) {
    const float x = -static_cast<float>(i) * 1e-3f;
    worst = std::max(worst, std::fabs(static_cast<double>(exp2NonPositive(x)) / std::exp2(static_cast<double>(x)) - 1));
  }
  CHECK(worst < 5e-7);
  CHECK(exp2NonPositive(0.0f) == 1.0f);
  for (const float x : {-127.0f, -1e30f, -kInfinity, std::nanf("")}) CHECK(exp2NonPositive(x) == 0x1p-126f);
}

TEST_CASE("Student's quantiles match the tables") {
  constexpr double z975 = 1.959963984540054;  // the 97.5 % point of the normal distribution
  CHECK(studentQuantile(z975, 2) == doctest::Approx(4.302653).epsilon(1e-6));
  CHECK(studentQuantile(z975, 4) == doctest::Approx(2.776445).epsilon(1e-6));
  CHECK(studentQuantile(z975, 6) == doctest::Approx(2.446912).epsilon(1e-6));
  CHECK(studentQuantile(z975, 30) == doctest::Approx(2.042272).epsilon(1e-6));
  CHECK(studentQuantile(z975, 62) == doctest::Approx(1.998972).epsilon(1e-5));
  CHECK(studentQuantile(z975, 120) == doctest::Approx(1.979930).epsilon(1e-5));
  CHECK(studentQuantile(1.6, uint64_t(1) << 40) == doctest::Approx(1.6));
}

TEST_CASE("The filter is what its formula says, at borders, with and without features, for full image and halves") {
  for (const auto& [width, height, step] : {std::array{1, 1, 1}, {7, 3, 1}, {33, 26, 2}, {150, 40, 11}}) {
    const Case c = caseOf(width, height, 8);
    for (const Features* features : {&featuresOf(c), static_cast<const Features*>(nullptr)}) {
      const PatchWelchInput input = patchWelchInput(c.pt(), features);
      const auto images = patchWelch(input, kThresholds);
      REQUIRE(images[0].size() == 3);
      for (size_t k = 0; k < kThresholds.size(); ++k)
        for (size_t i = 0; i < 3; ++i) {
          CAPTURE(width);
          CAPTURE(i);
          CHECK(worstDifference(images[k][i], PlainFilter(input, i, kThresholds[k]), step) < 1e-4);
        }
    }
  }
}

TEST_CASE("Fewer neighbours give the filter without the others") {
  const Case c = caseOf(60, 41, 8);
  const PatchWelchInput input = patchWelchInput(c.pt(), &featuresOf(c));
  for (const PatchWelchNeighbours& neighbours : {PatchWelchNeighbours{4, 4}, {0, 6}, {0, 0}}) {
    const auto images = patchWelch(input, kThresholds, neighbours);
    for (size_t k = 0; k < kThresholds.size(); ++k)
      for (size_t i = 0; i < 3; ++i)
        CHECK(worstDifference(images[k][i], PlainFilter(input, i, kThresholds[k], neighbours), 3) < 1e-4);
  }
}

TEST_CASE("Kept weights are those of the formula, for every pixel of the grid and any tiles") {
  for (const auto& [width, height, stride] : {std::array{1, 1, 5}, {7, 3, 1}, {60, 41, 7}}) {
    const Case c = caseOf(width, height, 8);
    const PatchWelchInput input = patchWelchInput(c.pt(), &featuresOf(c));
    const auto kept = [&](TileSize tiles) {
      PatchWelchWeights weights(width, height, 3, stride, {});
      patchWelch(input, std::array{kPatchWelchWideThreshold}, {}, tiles, nullptr, &weights);
      return weights;
    };
    const PatchWelchWeights usual = kept({}), small = kept({17, 5});
    CHECK(usual.count() == 173);
    double worst = 0, largest = 0;
    bool same = true;
    for (size_t i = 0; i < 3; ++i) {
      const PlainFilter plain(input, i, kPatchWelchWideThreshold);
      for (int y = 0; y < height; y += stride)
        for (int x = 0; x < width; x += stride)
          for (int dy = -9; dy <= 9; ++dy)
            for (int dx = -9; dx <= 9; ++dx) {
              if (!inPlainWindow(dx, dy) || (dx == 0 && dy == 0)) continue;
              const size_t k = usual.order(dx, dy);
              const bool inside = x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height;
              const double expected = inside ? plain.weight(x, y, x + dx, y + dy) : 0.0;
              const auto got = static_cast<double>(PatchWelchWeights::unpacked(usual.of(x, y, i)[k]));
              worst = std::max(worst, std::fabs(got - expected));
              largest = std::max(largest, got);
              same = same && usual.of(x, y, i)[k] == small.of(x, y, i)[k];
            }
    }
    CAPTURE(width);
    CHECK(worst < 1e-4);
    CHECK(same);
    if (width > 1) CHECK(largest > 0.5);
  }
}

TEST_CASE("Several thresholds in one pass give the bits of one pass each") {
  const Case c = caseOf(60, 41, 8);
  const auto both = patchWelch(patchWelchInput(c.pt(), &featuresOf(c)), kThresholds);
  for (size_t k = 0; k < 2; ++k) {
    const auto alone = filtered(c.pt(), &featuresOf(c), kThresholds[k]);
    for (size_t i = 0; i < 3; ++i) CHECK(identical(alone[i], both[k][i]));
  }
}

TEST_CASE("Neither tiles nor threads change a bit of the patch-Welch filter") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(257, 89, 8);
  const PatchWelchInput input = patchWelchInput(c.pt(), &featuresOf(c));
  const auto usual = patchWelch(input, kThresholds);
  for (const TileSize tiles : {TileSize{17, 5}, {64, 64}, {400, 200}, {257, 1}}) {
    const auto other = patchWelch(input, kThresholds, {}, tiles);
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual[1][i], other[1][i]));
  }
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    const auto other = arena.execute([&] { return patchWelch(input, kThresholds); });
    for (size_t i = 0; i < 3; ++i) CHECK(identical(usual[0][i], other[0][i]));
  }
}

TEST_CASE("A constant image is invariant, whatever its variance") {
  for (const float variance : {0.0f, 1e-8f, 1.0f, 1e8f}) {
    const Rgb<float> image(50, 37, 0.7f);
    CHECK(largestDifference(filtered(plainEstimate(image, variance), nullptr)[0], image) < 1e-6);
  }
}

TEST_CASE("Without variance the output is the input") {
  const Case c = caseOf(64, 48, 8);
  CHECK(largestDifference(filtered(plainEstimate(c.truth, 0), &featuresOf(c))[0], c.truth) < 1e-6);
}

TEST_CASE("Means eight standard deviations apart are not mixed, means one apart are") {
  for (const double z : kThresholds)
    for (const uint64_t passes : {4, 64}) {
      const float sd = 0.1f;
      const auto at = [&](float deviations) {
        const Rgb<float> image = halfPlanes(40, 20, 1, 1 + deviations * sd);
        Estimate e = plainEstimate(image, sd * sd);
        e.passes = passes;
        return largestDifference(filtered(e, nullptr, z)[0], image);
      };
      CHECK(at(8) < 1e-5);  // rounding of 440 additions
      CHECK(at(1) > 0.2 * static_cast<double>(sd));
    }
}

TEST_CASE("Light scales the output of the patch-Welch filter and nothing else") {
  const Case one = caseOf(64, 48, 8);
  const auto expected = filtered(one.pt(), &featuresOf(one));
  for (const double light : {0x1p-20, 0x1p20, 1e-6, 1e6}) {
    const Case scaled = caseOf(64, 48, 8, 1, light);
    Rgb<float> image = filtered(scaled.pt(), &featuresOf(scaled))[0];
    for (size_t c = 0; c < 3; ++c)
      for (float& v : image[c].data) v = static_cast<float>(static_cast<double>(v) / light);
    CAPTURE(light);
    // The samples are rounded anew; 1e-4 of a pixel is far above what that does through the weights.
    CHECK(largestDifference(image, expected[0]) < 1e-4);
  }
}

TEST_CASE("Four times the samples shrink the error of the patch-Welch filter, which is always below the noise" *
          doctest::test_suite("statistics")) {
  for (const double z : kThresholds) {
    double last = kInfinity;
    for (const uint64_t samples : {8, 32, 128, 512}) {
      const Case c = caseOf(96, 72, samples);
      const double error = meanSquaredError(filtered(c.pt(), &featuresOf(c), z)[0], c.truth);
      CAPTURE(samples);
      CHECK(error < 0.6 * last);
      CHECK(error < 0.25 * meanSquaredError(c.pt().mean, c.truth));
      last = error;
    }
  }
}

TEST_CASE("Black albedo, tiny and huge values and flushed subnormals leave finite images") {
#if defined(__SSE2__)
  const unsigned int mode = _mm_getcsr();
  _mm_setcsr(mode | 0x8040);  // flush to zero, denormals are zero
#endif
  tbb::task_arena here(1);
  here.execute([] {
    for (const double light : {1e-18, 1e-12, 1e12}) {
      Case c = caseOf(40, 30, 8, 1, light);
      for (size_t k = 0; k < 3; ++k) std::fill_n(c.estimates.features->albedo.mean[k].data.begin(), 600, 0.0f);
      const auto images = filtered(c.pt(), &featuresOf(c));
      for (const Rgb<float>& image : images) CHECK(allFinite(image));
    }
    Case c = caseOf(40, 30, 8);
    for (const float bad : {kInfinity, -kInfinity, std::nanf(""), 1e30f}) {
      Estimate e = c.pt();
      e.mean[0][77] = e.half[0][1][500] = e.variance[2][333] = e.variance[1][77] = bad;
      for (const Rgb<float>& image : filtered(e, &featuresOf(c))) CHECK(allFinite(image));
    }
  });
#if defined(__SSE2__)
  _mm_setcsr(mode);
#endif
}

TEST_CASE("Emitters and misses keep their radiance undivided, black albedo is floored") {
  Case c = caseOf(8, 1, 8);
  Features& f = *c.estimates.features;
  f.depth.mean[0] = 0;                                    // a miss
  f.albedo.mean.set(1, Vec3(0.5f, 1.5f, 0.5f));           // an emitter
  f.albedo.mean.set(2, Vec3(0, 0.2f, 1));                 // neither
  f.albedo.mean.set(3, Vec3(std::nanf(""), 0.2f, 0.3f));  // nonsense
  const PatchWelchInput input = patchWelchInput(c.pt(), &f);
  const PatchWelchTile tile(input, {0, 0, 8, 1}, 0);
  const auto divisor = [&](int x) {
    const auto i = static_cast<size_t>(tile.index(x, 0));
    return Vec3(tile.divisor[0][i], tile.divisor[1][i], tile.divisor[2][i]);
  };
  CHECK(divisor(0) == Vec3(1));
  CHECK(divisor(1) == Vec3(1));
  CHECK(divisor(2) == Vec3(0.03f, 0.2f, 1));
  CHECK(divisor(3) == Vec3(0.03f, 0.2f, 0.3f));
}

TEST_CASE("Pixels where every ray has missed the scene and those at its edge are not mixed") {
  // A black background below an edge that covers a tenth of its pixels, as noisy as light that is rarely met.
  constexpr int kEdge = 12;
  Case c = caseOf(40, 24, 8);
  Features& f = *c.estimates.features;
  Estimate e = plainEstimate(Rgb<float>(40, 24, 0.0f), 0);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 40; ++x) {
      const size_t i = e.mean[0].index(x, y);
      const bool miss = y > kEdge;
      f.depth.mean.data[i] = miss ? 0.0f : 0.3f;
      f.albedo.mean.set(i, Vec3(miss ? 0.0f : 0.07f));
      f.normal.mean.set(i, Vec3(0, 0, -1));
      if (miss) continue;
      e.mean.set(i, Vec3(x % 4 == 0 ? 0.04f : 0.0f));
      for (size_t k = 0; k < 3; ++k) e.variance[k].data[i] = 0.0003f;
    }
  const Rgb<float> image = filtered(e, &f, kPatchWelchWideThreshold)[0];
  double background = 0, edge = 0;
  for (int x = 10; x < 30; ++x) {
    background = std::max(background, static_cast<double>(image[0].at(x, kEdge + 1)));
    edge += static_cast<double>(image[0].at(x, kEdge)) / 20;
  }
  CHECK(background < 1e-30);
  CHECK(edge == doctest::Approx(0.01).epsilon(0.1));
}

TEST_CASE("The halves average to the full output within the noise") {
  const Case c = caseOf(96, 72, 64);
  const auto images = filtered(c.pt(), &featuresOf(c));
  Rgb<float> average = images[1];
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < average.size(); ++i) average[k][i] = 0.5f * (images[1][k][i] + images[2][k][i]);
  // The average may differ from the full output by what the filter itself errs, not by what the input does.
  const double difference = meanSquaredError(average, images[0]);
  CHECK(difference > 0);
  CHECK(difference < meanSquaredError(images[0], c.truth));
  CHECK(difference < 0.1 * meanSquaredError(c.pt().mean, c.truth));
}

TEST_CASE("The other half estimates the error of a half within a factor of two" * doctest::test_suite("statistics")) {
  for (const uint64_t samples : {16, 64}) {
    double estimated = 0, actual = 0;
    for (uint64_t seed = 1; seed <= 8; ++seed) {
      const Case c = caseOf(96, 72, samples, seed);
      const auto images = filtered(c.pt(), &featuresOf(c));
      for (size_t h = 0; h < 2; ++h) {
        estimated += meanSquaredError(images[1 + h], c.pt().half[1 - h]);
        actual += meanSquaredError(images[1 + h], c.truth);
        for (size_t k = 0; k < 3; ++k)  // less the variance of the other half
          for (const float v : c.pt().variance[k].data)
            estimated -= 2 * static_cast<double>(v) / static_cast<double>(3 * c.truth.size());
      }
    }
    CAPTURE(samples);
    CAPTURE(estimated / actual);
    CHECK(estimated > 0.5 * actual);
    CHECK(estimated < 2 * actual);
  }
}

TEST_CASE("The regularised variance has the right mean at any number of passes, and is nowhere zero beside noise" *
          doctest::test_suite("statistics")) {
  for (const uint64_t samples : {2, 3, 4, 16}) {
    double estimated = 0, actual = 0;
    bool positive = true;
    for (uint64_t seed = 1; seed <= 6; ++seed) {
      const Case c = caseOf(96, 72, samples, seed);
      const Rgb<float> variance = regularisedVariance(c.pt());
      estimated += meanOfImage(variance);
      actual += meanSquaredError(c.pt().mean, c.truth);
      for (size_t k = 0; k < 3; ++k)
        for (const float v : variance[k].data) positive = positive && v > 0;
    }
    CAPTURE(samples);
    CAPTURE(estimated / actual);
    // 124,416 squares of a factor with kurtosis below 20, with up to 3x between dark and bright: 4 standard errors.
    CHECK(estimated == doctest::Approx(actual).epsilon(0.06));
    CHECK(positive);
  }
}

TEST_CASE("Two and three passes are denoised by the variance of the halves, one is refused") {
  const std::unique_ptr<Method> method = patchWelchMethod("pw", "the filter under test", kPatchWelchThreshold);
  for (const uint64_t samples : {2, 3}) {
    const Case c = caseOf(96, 72, samples);
    const MethodResult result = method->run(inputsOf(c));
    CHECK(meanSquaredError(result.image.mean, c.truth) < 0.5 * meanSquaredError(c.pt().mean, c.truth));
    CHECK(allFinite(result.image.half[1]));
  }
  CHECK_THROWS_AS(method->run(inputsOf(caseOf(16, 12, 1))), Error);
}

TEST_CASE("Where only the mean is read, halves are left out and the mean keeps its bits") {
  const Case c = caseOf(70, 40, 8);
  for (const auto& make : {make_pw, make_pw1, make_nlm, make_box}) {
    const std::unique_ptr<Method> method = make();
    CAPTURE(method->name());
    MethodInputs in = inputsOf(c);
    const MethodResult all = method->run(in);
    in.meanOnly = true;
    const MethodResult meanOnly = method->run(in);
    CHECK_FALSE(all.image.half[1].empty());
    CHECK(meanOnly.image.half[1].empty());
    for (size_t k = 0; k < 3; ++k) CHECK(meanOnly.image.mean[k].data == all.image.mean[k].data);
  }
}

TEST_CASE("Planes that an image of another renderer lacks are done without") {
  const Case c = caseOf(96, 72, 32);
  const double noise = meanSquaredError(c.pt().mean, c.truth);
  const auto error = [&](const Estimate& e, const Features* f) { return meanSquaredError(filtered(e, f)[0], c.truth); };
  Features albedoOnly = featuresOf(c);
  albedoOnly.normal.mean = Rgb<float>();
  albedoOnly.depth.mean = albedoOnly.visibility.mean = Plane<float>();
  CHECK(error(c.pt(), &albedoOnly) < 0.25 * noise);
  CHECK(error(c.pt(), nullptr) < 0.5 * noise);
  Estimate noVariance = c.pt();
  noVariance.variance = Rgb<float>();
  CHECK(error(noVariance, &featuresOf(c)) < 0.25 * noise);
  Estimate noHalves = c.pt();
  noHalves.half[0] = noHalves.half[1] = Rgb<float>();
  CHECK(filtered(noHalves, &featuresOf(c)).size() == 1);
  CHECK(error(noHalves, &featuresOf(c)) < 0.25 * noise);
}

}  // namespace braid::test_pw
