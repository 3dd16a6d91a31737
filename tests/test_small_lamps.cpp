// SPDX-License-Identifier: Apache-2.0
// Lamps of a pixel or less, 30,000 times as bright as what is around them: no filter may smear them, for that is an
// error of 10⁸ in relL2.
#include <cmath>
#include <string>
#include <utility>

#include <doctest/doctest.h>

#include "combiners/pipeline.h"
#include "combiners/registry.h"
#include "tests/combiner_fixture.h"

using namespace braid;
using namespace braid::test;

namespace {

constexpr int kWidth = 48, kHeight = 36;
constexpr double kDark = 0.01, kLamp = 350, kCoverage = 0.9;

// Lamps that cover nine tenths of a pixel, at even and odd positions as strided models see them.
const std::pair<int, int> kLamps[] = {{10, 10}, {31, 9}, {12, 25}, {33, 26}};

bool isLamp(int x, int y) {
  for (const auto& [u, v] : kLamps)
    if (x == u && y == v) return true;
  return false;
}

// A dark wall with lamps, and features that know nothing of the lamps.
Estimates lampsOnWall(uint64_t samples, uint64_t seed) {
  CaseOptions o;
  o.width = kWidth;
  o.height = kHeight;
  o.samples = samples;
  o.seed = seed;
  Estimates e = makeCase(o).estimates;
  e.estimates = {detail::estimateOfSamples("pt", o, [&](uint64_t pass, size_t i, size_t channel) {
    const double u = detail::uniform(seed, 5, pass, 3 * static_cast<uint64_t>(i) + channel);
    const double covered = detail::uniform(seed, 6, pass, static_cast<uint64_t>(i));
    const bool lamp = isLamp(static_cast<int>(i) % kWidth, static_cast<int>(i) / kWidth) && covered < kCoverage;
    return lamp ? kLamp : kDark * detail::factor(std::max(u, 1e-12), 0.5);
  })};
  e.history.clear();
  return e;
}

}  // namespace

TEST_CASE("No denoiser lights what is beside a small lamp by the lamp") {
  for (const uint64_t samples : {32u, 128u})
    for (uint64_t seed = 1; seed < 4; ++seed) {
      const Estimates e = lampsOnWall(samples, seed);
      for (const std::string name : {"pw", "pw-wide", "pw1", "nlm", "nfor", "rdfc", "ensemble@nfor+rdfc", "auto"}) {
        const PipelineResult r = runPipeline(e, {name}, {});
        REQUIRE(r.find(name)->ran());
        const Rgb<float>& image = r.find(name)->result.image.mean;
        CAPTURE(name);
        for (int y = 0; y < kHeight; ++y)
          for (int x = 0; x < kWidth; ++x)
            if (!isLamp(x, y)) CHECK(static_cast<double>(image[0].at(x, y)) < 3 * kDark);
        for (const auto& [x, y] : kLamps) CHECK(static_cast<double>(image[0].at(x, y)) > 0.5 * kCoverage * kLamp);
      }
    }
}
