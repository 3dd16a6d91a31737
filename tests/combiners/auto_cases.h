// SPDX-License-Identifier: Apache-2.0
// Inputs for the combiner "auto" and its parts, and runs of it.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test::auto_cases {

// The estimates of the names and the features.
inline Estimates kept(const Case& c, const std::vector<std::string>& names) {
  Estimates e = c.estimates;
  std::erase_if(e.estimates, [&](const Estimate& x) { return !std::count(names.begin(), names.end(), x.name); });
  return e;
}

inline PipelineOutput outputOf(const Estimates& e, const std::string& method, const PipelineOptions& options = {}) {
  const PipelineResult result = runPipeline(e, {method}, options);
  const PipelineOutput* out = result.find(method);
  REQUIRE(out);
  INFO(out->step.skipReason);
  REQUIRE(out->ran());
  return *out;
}

inline Case noisyCase(uint64_t samples, double fireflies = 0, uint64_t seed = 1) {
  CaseOptions o;
  o.width = 96;
  o.height = 72;
  o.samples = samples;
  o.fireflies = fireflies;
  o.seed = seed;
  return makeCase(o);
}

inline double relativeSum(const Plane<float>& error, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t i = 0; i < error.size(); ++i) {
    double level = 0;
    for (size_t c = 0; c < 3; ++c) level += static_cast<double>(truth[c][i]) / 3;
    sum += static_cast<double>(error[i]) / (level * level + 0.01);
  }
  return sum / static_cast<double>(error.size());
}

// A grey image whose quarters and halves agree, with the given variance.
inline Estimate flat(float value, float variance, int width = 40, int height = 30) {
  Estimate e;
  e.passes = 64;
  e.mean = e.half[0] = e.half[1] = Rgb<float>(width, height, value);
  e.quarter.assign(4, e.mean);
  e.variance = Rgb<float>(width, height, variance);
  return e;
}

inline void setPixel(Estimate& e, size_t i, float value, const std::array<float, 4>& quarters, float variance) {
  for (size_t c = 0; c < 3; ++c) {
    e.mean[c][i] = value;
    for (size_t q = 0; q < 4; ++q) e.quarter[q][c][i] = quarters[q];
    e.half[0][c][i] = 0.5f * (quarters[0] + quarters[2]);
    e.half[1][c][i] = 0.5f * (quarters[1] + quarters[3]);
    e.variance[c][i] = variance;
  }
}

}  // namespace braid::test::auto_cases
