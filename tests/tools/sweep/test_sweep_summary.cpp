// SPDX-License-Identifier: Apache-2.0
// What `braid sweep` makes of images and rows: errors without the reference's noise, curves, summaries, tables,
// pictures.
#include <cmath>
#include <functional>
#include <random>
#include <tuple>

#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "tests/support/gltf_fixture.h"
#include "tools/metrics/metrics.h"
#include "tools/sweep/report/html.h"
#include "tools/sweep/report/pictures.h"
#include "tools/sweep/table/sweep_error.h"
#include "tools/sweep/table/sweep_summary.h"
#include "tools/sweep/table/sweep_table.h"

namespace braid::test_sweep_summary {

using test::Folder;

namespace {

std::pair<ExitCode, std::string> failureOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return {e.code(), e.what()};
  }
  return {ExitCode::Ok, ""};
}

Curve powerLaw(double factor, double slope, const std::vector<double>& seconds) {
  Curve curve;
  for (double t : seconds) {
    LadderPoint p;
    p.mark = p.spp = p.seconds = t;
    p.error = p.low = p.high = factor * std::pow(t, slope);
    curve.push_back(p);
  }
  return curve;
}

// A table with one column of errors beside those that a summary reads.
SweepTable tableOf(const std::vector<std::tuple<const char*, const char*, double, double, double>>& rows) {
  SweepTable t;
  t.columns = {"MSE", "better_pixels"};
  for (const auto& [scene, method, mark, seconds, error] : rows) {
    SweepRow r;
    r.scene = scene;
    r.method = method;
    r.mark = mark;
    r.spp = static_cast<uint64_t>(mark);
    r.render = seconds;
    r.values = {error, std::nan("")};
    t.rows.push_back(r);
  }
  return t;
}

}  // namespace

TEST_CASE("With two references the reference's noise drops out of the error") {
  // Truth 1 everywhere, image with standard deviation 0.1, references with 0.3 each. relL2 of the image is
  // 0.01/1.01 plus 0.045/1.01 of the references' mean; the product of differences lacks the latter.
  constexpr int kSize = 128;
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  const auto noisy = [&](float deviation) {
    Rgb<float> image(kSize, kSize);
    for (size_t c = 0; c < 3; ++c)
      for (float& v : image[c].data) v = 1 + deviation * normal(random);
    return image;
  };
  const Rgb<float> image = noisy(0.1f);
  ReferenceImage r;
  r.half[0] = noisy(0.3f);
  r.half[1] = noisy(0.3f);
  r.mean = Rgb<float>(kSize, kSize);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i) r.mean[c][i] = 0.5f * (r.half[0][c][i] + r.half[1][c][i]);
  // The denominator mean_RGB(R)² + 0.01 varies with the reference as well: mean_RGB(R) has variance 0.015, and
  // E 1/(x² + 0.01) = (1 + 3 · 0.015 / 1.01) / 1.01 to second order, 4.4 % above 1/1.01.
  const double expected = 0.01 / 1.01 * 1.044, noise = 0.045 / 1.01 * 1.044;
  // The product's standard deviation per value is about 0.11, over 49152 values 5e-4: 4 standard errors are 2e-3, a
  // false alarm in 16,000.
  CHECK(std::fabs(relL2Unbiased(image, r) - expected) < 2e-3);
  CHECK(std::fabs(referenceNoise(r) - noise) < 2e-3);
  const double plain = evaluate(*findMetric("relL2"), image, r.mean).value;
  CHECK(std::fabs(plain - expected - noise) < 3e-3);
  CHECK(plain > 4 * relL2Unbiased(image, r));

  ReferenceImage single;
  single.mean = r.mean;
  CHECK(std::isnan(relL2Unbiased(image, single)));
  Rgb<float> broken = image;
  broken[1][5] = std::nanf("");
  CHECK(std::isinf(relL2Unbiased(broken, r)));
  r.half[1][0][5] = INFINITY;
  CHECK(std::isfinite(relL2Unbiased(broken, r)));
  const Dominance d = dominance(r.mean, image, r.mean);
  CHECK(d.betterPixels == 1);
  CHECK(d.squaredDifference < 0);
}

TEST_CASE("Times to equal error are exact on power laws") {
  const Curve slow = powerLaw(2, -1, {1, 2, 4, 8, 16}), fast = powerLaw(0.4, -1, {1, 3, 7, 16}),
              steep = powerLaw(2, -2, {1, 16});
  CHECK(*errorAtTime(slow, 3) == doctest::Approx(2.0 / 3).epsilon(1e-12));
  CHECK(*errorAtTime(steep, 5) == doctest::Approx(2.0 / 25).epsilon(1e-12));
  CHECK(*errorAtTime(slow, 16) == doctest::Approx(2.0 / 16).epsilon(1e-12));
  CHECK_FALSE(errorAtTime(slow, 0.5));
  CHECK_FALSE(errorAtTime(slow, 17));
  using Kind = TimeToError::Kind;
  const TimeToError half = timeToError(fast, slow.back().error);  // 0.4 / t = 2 / 16
  CHECK(half.kind == Kind::Reached);
  CHECK(half.seconds == doctest::Approx(3.2).epsilon(1e-12));
  CHECK(timeToError(steep, 2.0 / 9).seconds == doctest::Approx(3).epsilon(1e-12));
  CHECK(timeToError(slow, slow.back().error).seconds == 16);
  CHECK(timeToError(slow, 0.01).kind == Kind::Never);
  CHECK(timeToError(slow, 3).kind == Kind::FromTheStart);
  CHECK(timeToError({}, 1).kind == Kind::Never);
  // An error of zero has no logarithm.
  Curve exact = slow;
  exact.back().error = 0;
  CHECK(std::isfinite(*errorAtTime(exact, 12)));
  CHECK(std::isfinite(timeToError(exact, 0.1).seconds));
}

TEST_CASE("The summary's ratios, ranks and wins are those of its rows") {
  // Scene a: x has a quarter of pt's error at every time. Scene b: x needs twice pt's time for pt's error.
  const SweepTable t = tableOf({{"a", "pt", 1, 1, 8},
                                {"a", "pt", 4, 4, 2},
                                {"a", "x", 1, 1, 2},
                                {"a", "x", 4, 4, 0.5},
                                {"b", "pt", 1, 1, 8},
                                {"b", "pt", 4, 4, 2},
                                {"b", "x", 1, 1, 16},
                                {"b", "x", 4, 4, 4}});
  const SweepSummary s = summarise(t, {"a", "b"}, {"x", "pt"});
  CHECK(s.baseline == "pt");
  CHECK(s.errorColumn == "MSE");
  REQUIRE(s.find("a", "x"));
  CHECK(*s.find("a", "x")->errorRatio == doctest::Approx(0.25));
  CHECK(s.find("a", "x")->toBaseline.seconds == doctest::Approx(0.25));
  CHECK(*s.find("b", "x")->errorRatio == doctest::Approx(2));
  CHECK(s.find("b", "x")->toBaseline.kind == TimeToError::Kind::Never);
  CHECK(shortRatio(s.find("b", "x")->toBaseline) == "> 1");
  CHECK(*s.find("b", "x")->gains[1] == doctest::Approx(0.5));
  CHECK_FALSE(s.find("b", "x")->gains[2]);
  CHECK(*s.overall[0].errorRatio == doctest::Approx(std::sqrt(0.5)));
  CHECK(s.overall[0].timeScenes == 1);
  CHECK(*s.overall[1].errorRatio == doctest::Approx(1));
  CHECK(s.overall[0].winRates[1] == doctest::Approx(0.5));
  CHECK(s.overall[0].score == doctest::Approx(1.5));
  const SweepSummary one = summarise(t, {"a"}, {"x", "pt"});
  CHECK(one.overall[0].score == doctest::Approx(2));
  CHECK(one.overall[1].score == doctest::Approx(1));
  CHECK(one.overall[0].winRates[1] == 1);
  CHECK(toMarkdown(s).find("| b | x | 4 s | 4 | 2 | > 1 |") != std::string::npos);
  CHECK(toJson(s)["cells"].size() == 4);
}

TEST_CASE("A table reads back what was written, and damage is named by its line") {
  const Folder folder;
  SweepTable t = tableOf({{"a", "pt", 0.5, 1.25, 1.0 / 3}, {"a", "pt", 4, 4, INFINITY}});
  t.rows[0].ladder = Ladder::Time;
  const std::string file = (folder.path / "t.csv").string();
  writeSweepTable(file, t);
  appendSweepRow(file, t.rows[0]);
  const SweepTable back = readSweepTable(file);
  REQUIRE(back.rows.size() == 3);
  CHECK(back.columns == t.columns);
  CHECK(sameCell(back.rows[0], t.rows[0]));
  CHECK(back.rows[0].values[0] == 1.0 / 3);
  CHECK(std::isnan(back.rows[0].values[1]));
  CHECK(std::isinf(back.rows[1].values[0]));
  CHECK(back.rows[2].render == 1.25);
  folder.write("short.csv", csvHeader(t) + "a,pt,spp,1\n");
  const auto [code, reason] = failureOf([&] { readSweepTable((folder.path / "short.csv").string()); });
  CHECK(code == ExitCode::BadInput);
  CHECK(reason.find("line 2: 4 fields instead of 12") != std::string::npos);
}

TEST_CASE("Pictures are encoded and crops lie where errors are") {
  CHECK(base64("") == "");
  CHECK(base64("f") == "Zg==");
  CHECK(base64("fo") == "Zm8=");
  CHECK(base64("foobar") == "Zm9vYmFy");
  Plane<double> errors(40, 30);
  for (int y = 20; y < 28; ++y)
    for (int x = 24; x < 32; ++x) errors.at(x, y) = 1;
  errors.at(1, 1) = 1e9;  // a firefly does not decide
  const PixelWindow w = worstWindow(errors, 8);
  CHECK((w == PixelWindow{24, 20, 32, 28}));
  const Rgb<float> black(5, 3);
  CHECK(exposureOf(black) == 1);
  const Picture p = toneMapped(black, 1);
  CHECK(p.rgb == std::vector<uint8_t>(45, 0));
  CHECK(dataUri(p).rfind("data:image/png;base64,iVBOR", 0) == 0);
  Picture large{300, 300, std::vector<uint8_t>(270000, 128)};
  CHECK(dataUri(large).size() < 60000);
  CHECK(escaped("<a & \"b\">") == "&lt;a &amp; &quot;b&quot;&gt;");
  Rgb<float> wide(9, 4, 2.0f);
  CHECK(shrunk(wide, 4).width() == 3);
  CHECK(shrunk(wide, 4)[0].at(2, 1) == 2);
}

}  // namespace braid::test_sweep_summary
