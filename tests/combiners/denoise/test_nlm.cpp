// SPDX-License-Identifier: Apache-2.0
// Non-local means: the weights against a plain double-precision transcription of the distance, and what the filter
// promises.
#include <array>
#include <cmath>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/nlm/nlm_filter.h"
#include "combiners/statistics/variance.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test_nlm {

using namespace test;

namespace {

// The weight of a pair in double, straight from the formula.
double plainWeight(std::span<const NlmGuide> guides, int x, int y, int u, int v) {
  double largest = 0;
  for (const NlmGuide& g : guides) {
    const int width = g.mean[0]->width, height = g.mean[0]->height;
    const auto inside = [&](int a, int b) { return a >= 0 && b >= 0 && a < width && b < height; };
    double sum = 0, count = 0;
    for (int j = -g.patch; j <= g.patch; ++j)
      for (int i = -g.patch; i <= g.patch; ++i) {
        if (!inside(x + i, y + j) || !inside(u + i, v + j)) continue;
        for (size_t c = 0; c < g.mean.size(); ++c) {
          const auto value = [&](const Plane<float>& p, int a, int b) {
            return static_cast<double>(p.at(a + i, b + j));
          };
          const double scale = static_cast<double>(g.varianceScale);
          const double vp = scale * value(*g.variance[c], x, y), vq = scale * value(*g.variance[c], u, v);
          const double d2 = sqr(value(*g.mean[c], x, y) - value(*g.mean[c], u, v)) - (vp + std::min(vp, vq));
          sum += std::min(1e4, d2 / (sqr(static_cast<double>(g.k)) * (vp + vq) + static_cast<double>(g.epsilon)));
          ++count;
        }
      }
    largest = std::max(largest, sum / count);
  }
  return std::exp(-largest);
}

double worstWeight(std::span<const NlmGuide> guides, const PixelRect& tile) {
  NlmWeights weights(guides, 5, tile);
  const int width = guides[0].mean[0]->width, height = guides[0].mean[0]->height;
  double worst = 0;
  for (int dy = -4; dy <= 4; dy += 2)
    for (int dx = -5; dx <= 5; ++dx) {
      const float* w = weights.at(dx, dy);
      for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x, ++w) {
          const bool pair = x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height;
          const double expected = pair ? plainWeight(guides, x, y, x + dx, y + dy) : 0;
          worst = std::max(worst, std::fabs(static_cast<double>(*w) - expected));
        }
    }
  return worst;
}

Rgb<float> filtered(const Case& c, float k = 0.45f) {
  const Rgb<float> variance = regularisedVariance(c.pt());
  return nlmFilter(nlmGuide(c.pt().mean, variance, k, 3), 10, c.pt().mean);
}

}  // namespace

TEST_CASE("The weights of non-local means are what their formula says, for any patch and at borders") {
  for (const auto& [width, height] : {std::array{1, 1}, {7, 3}, {40, 30}}) {
    const Case c = caseOf(width, height, 16);
    const Estimate& e = c.pt();
    for (const int patch : {0, 1, 2, 3, 5}) {
      const NlmGuide guide = nlmGuide(e.mean, e.variance, 0.7f, patch);
      CAPTURE(width);
      CAPTURE(patch);
      CHECK(worstWeight(std::span(&guide, 1), {0, 0, width, height}) < 1e-4);
      CHECK(worstWeight(std::span(&guide, 1), {width / 2, height / 3, width, height}) < 1e-4);
    }
  }
}

TEST_CASE("Of several guides the largest distance counts, with their own scale and patch") {
  const Case c = caseOf(40, 30, 16);
  const Estimate& e = c.pt();
  const FeaturePlanes<Plane<float>>& depth = c.estimates.features->depth;
  NlmGuide red = nlmGuide(e.mean[0], e.variance[0], 0.5f, 3), feature = nlmGuide(depth.mean, depth.variance, 0.6f, 0);
  red.varianceScale = 2;
  feature.epsilon = 1e-10f;
  const std::array guides = {red, feature};
  CHECK(worstWeight(guides, {3, 5, 38, 30}) < 1e-4);
  // Both matter somewhere.
  const PixelRect all = {0, 0, 40, 30};
  NlmWeights both(guides, 3, all), one({&guides[0], 1}, 3, all), other({&guides[1], 1}, 3, all);
  const float *w = both.at(3, 1), *a = one.at(3, 1), *b = other.at(3, 1);
  int first = 0, second = 0;
  for (size_t i = 0; i < 1200; ++i) {
    CHECK(w[i] == std::min(a[i], b[i]));
    first += a[i] < b[i];
    second += b[i] < a[i];
  }
  CHECK(first > 50);
  CHECK(second > 50);
}

TEST_CASE("The filter is the weighted mean over the window, for several targets at once") {
  const Case c = caseOf(37, 23, 16);
  const Estimate& e = c.pt();
  const NlmGuide guide = nlmGuide(e.mean, e.variance, 0.6f, 2);
  Plane<float> outA(37, 23), outB(37, 23);
  const std::array<const Plane<float>*, 2> in = {&e.mean[1], &c.estimates.features->depth.mean};
  const std::array<Plane<float>*, 2> out = {&outA, &outB};
  nlmFilter(std::span(&guide, 1), 4, in, out);
  for (int y = 0; y < 23; y += 2)
    for (int x = 0; x < 37; x += 3) {
      double total = 0, sum[2] = {0, 0};
      for (int v = std::max(0, y - 4); v <= std::min(22, y + 4); ++v)
        for (int u = std::max(0, x - 4); u <= std::min(36, x + 4); ++u) {
          const double w = plainWeight(std::span(&guide, 1), x, y, u, v);
          total += w;
          for (size_t t = 0; t < 2; ++t) sum[t] += w * static_cast<double>(in[t]->at(u, v));
        }
      for (size_t t = 0; t < 2; ++t) CHECK(out[t]->at(x, y) == doctest::Approx(sum[t] / total).epsilon(1e-4));
    }
}

TEST_CASE("A pixel has weight one with itself, also without variance") {
  const Rgb<float> image(9, 5, 3.0f), none(9, 5);
  const NlmGuide guide = nlmGuide(image, none, 0.45f, 3);
  NlmWeights weights(std::span(&guide, 1), 0, {0, 0, 9, 5});
  const float* w = weights.at(0, 0);
  for (int i = 0; i < 45; ++i) CHECK(w[i] == 1.0f);
}

TEST_CASE("Values at the end of the range have finite weights, and a pixel has weight one with itself") {
  Rgb<float> image(9, 5, 3e38f);
  image[0].at(4, 2) = image[1].at(6, 3) = -3e38f;
  const Rgb<float> variance(9, 5, 3e38f);
  NlmGuide guide = nlmGuide(image, variance, 100.0f, 3);
  guide.varianceScale = 2;
  NlmWeights weights(std::span(&guide, 1), 2, {0, 0, 9, 5});
  const float *own = weights.at(0, 0), *other = weights.at(2, 1);
  for (int i = 0; i < 45; ++i) {
    CHECK(own[i] == 1.0f);
    CHECK(std::isfinite(other[i]));
  }
}

TEST_CASE("Without variance non-local means returns its input") {
  const Case c = caseOf(64, 48, 8);
  const Rgb<float> none(64, 48);
  const Rgb<float> out = nlmFilter(nlmGuide(c.truth, none, 0.45f, 3), 10, c.truth);
  // Differences below sqrt(epsilon) = 3e-4 do not count as differences.
  CHECK(std::sqrt(meanSquaredError(out, c.truth)) < 1e-3);
}

TEST_CASE("Four times the samples shrink the error of non-local means, which is always below the noise") {
  double last = kInfinity;
  for (const uint64_t samples : {8, 32, 128, 512}) {
    const Case c = caseOf(96, 72, samples);
    const double error = meanSquaredError(filtered(c), c.truth);
    CHECK(error < 0.7 * last);
    CHECK(error < 0.5 * meanSquaredError(c.pt().mean, c.truth));
    last = error;
  }
}

TEST_CASE("The halves of non-local means are filtered by their own weights") {
  const Case c = caseOf(96, 72, 64);
  const MethodResult result = make_nlm()->run(inputsOf(c));
  const Rgb<float> variance = regularisedVariance(c.pt());
  NlmGuide guide = nlmGuide(c.pt().half[1], variance, 0.45f, 3);
  guide.varianceScale = 2;
  CHECK(identical(result.image.half[1], nlmFilter(guide, 10, c.pt().half[1])));
  double estimated = 0, actual = 0;
  for (size_t h = 0; h < 2; ++h) {
    estimated += meanSquaredError(result.image.half[h], c.pt().half[1 - h]) - 2 * meanOfImage(c.pt().variance);
    actual += meanSquaredError(result.image.half[h], c.truth);
  }
  CAPTURE(estimated / actual);
  CHECK(estimated > 0.5 * actual);
  CHECK(estimated < 2 * actual);
}

TEST_CASE("The number of threads changes no bit of non-local means") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Case c = caseOf(300, 89, 8);
  const Rgb<float> usual = filtered(c);
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    CHECK(identical(usual, arena.execute([&] { return filtered(c); })));
  }
}

}  // namespace braid::test_nlm
