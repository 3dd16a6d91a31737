// SPDX-License-Identifier: Apache-2.0
// What there is to combine, without its pixels: what a plan is made of before a render, and a file after it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// What is known of an estimate without its pixels.
struct AvailableEstimate {
  std::string name;
  bool unbiased = true;
  Correlation correlation = Correlation::Independent;
  uint64_t passes = 0;  // 0: not known
  bool halves = true, variance = true, quarters = false;
  int checkpoints = 0;
  std::vector<uint64_t> kept{};  // passes of the checkpoints with their image, rising
  bool bias = false;             // whether there is an estimate of it
  bool directIndirect = false;   // whether direct light is known by itself
};

struct AvailableEstimates {
  std::vector<AvailableEstimate> estimates;
  bool features = false;
  bool reference = false;
  const AvailableEstimate* find(const std::string& name) const;
};
AvailableEstimates availableIn(const Estimates& estimates);

// The estimate in the role of the unbiased one where no user names it; empty: there is none.
std::string defaultUnbiased(const AvailableEstimates& available);

}  // namespace braid
