// SPDX-License-Identifier: Apache-2.0
// Every method of the registry on every kind of estimate, for tests of what all of them must keep.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"

namespace braid::test {

// The methods that can run here: without those that want a file or a library.
inline std::vector<std::shared_ptr<const Method>> runnableMethods() {
  std::vector<std::shared_ptr<const Method>> list;
  for (auto& m : makeMethods()) {
    const auto* outside = dynamic_cast<const ExternalMethod*>(m.get());
    if (!outside || outside->skipReason().empty()) list.push_back(std::move(m));
  }
  return list;
}

// Everything that a method may need: pt with history, crn, sppm, two denoised images as bases, and the truth.
inline Estimates everything(const Case& c) {
  Estimates e = c.estimates;
  for (const Estimate& d : c.denoised) e.estimates.push_back(d);
  e.reference = c.truth;
  return e;
}

inline PipelineOptions basesNamed() {
  PipelineOptions options;
  options.roles.bases = {"narrow", "wide", "sppm"};
  return options;
}

// The method on the estimates. Those that run their denoiser again get the box filter, the others the photon map.
inline PipelineOutput outputOf(const Method& method, const Estimates& estimates) {
  std::string name = method.name();
  if (method.needs().redenoise)
    name += "@box";
  else if (method.needs().biased)
    name += "@sppm";
  const PipelineResult result = runPipeline(estimates, {name}, basesNamed());
  REQUIRE(result.find(name));
  return *result.find(name);
}

// Relative distance of two images: square root of summed squared differences over summed squares.
inline double relativeDistance(const Rgb<float>& a, const Rgb<float>& b) {
  double difference = 0, square = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < b.size(); ++i) {
      difference += sqr(static_cast<double>(a[c][i]) - static_cast<double>(b[c][i]));
      square += sqr(static_cast<double>(b[c][i]));
    }
  return std::sqrt(difference / square);
}

}  // namespace braid::test
