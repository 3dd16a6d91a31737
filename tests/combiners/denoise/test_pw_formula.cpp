// SPDX-License-Identifier: Apache-2.0
// The formula of the patch-Welch filter against a plain transcription in double.
#include <array>
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/denoise/pw/pw_filter.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/plain_window.h"

namespace braid::test_pw_formula {

using namespace test;

namespace {

constexpr std::array kThresholds = {kPatchWelchThreshold, kPatchWelchWideThreshold};

const Features& featuresOf(const Case& c) { return *c.estimates.features; }

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
        if (!inPlainWindow(u - x, v - y, neighbours_.radius)) continue;
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
  for (const PatchWelchNeighbours& neighbours : {PatchWelchNeighbours{4}, {6}, {0}}) {
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
    CHECK(usual.count() == 197);
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

}  // namespace braid::test_pw_formula
