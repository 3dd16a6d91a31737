// SPDX-License-Identifier: Apache-2.0
// What a result says of the stop of denoising.
#pragma once

#include <string>

#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"

namespace braid::test::denoise_cutoff {

inline PipelineOptions stoppedAt(uint64_t stop) {
  PipelineOptions options;
  options.roles.stop = stop;
  return options;
}

inline const PipelineOutput& outputOf(const PipelineResult& result, const std::string& name) {
  const PipelineOutput* out = result.find(name);
  REQUIRE(out);
  INFO(out->step.skipReason);
  REQUIRE(out->ran());
  return *out;
}

inline MethodResult curvesOf(const Estimates& e, uint64_t stop) {
  return outputOf(runPipeline(e, {"curves@box"}, stoppedAt(stop)), "curves@box").result;
}

inline const Attribute* remark(const MethodResult& r, const std::string& name) {
  for (const Attribute& a : r.remarks)
    if (a.name == name) return &a;
  return nullptr;
}

}  // namespace braid::test::denoise_cutoff
