// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/available_estimates.h"

#include "combiners/pipeline/method_names.h"

namespace braid {

const AvailableEstimate* AvailableEstimates::find(const std::string& name) const {
  for (const AvailableEstimate& e : estimates)
    if (e.name == name) return &e;
  return nullptr;
}

AvailableEstimates availableIn(const Estimates& all) {
  AvailableEstimates available;
  available.features = all.features.has_value();
  available.reference = !all.reference.empty();
  for (const Estimate& e : all.estimates) {
    const auto history = all.history.find(e.name);
    std::vector<uint64_t> kept;
    if (history != all.history.end())
      for (const Checkpoint& c : history->second)
        if (!c.mean.empty() && c.passes >= 2) kept.push_back(c.passes);
    available.estimates.push_back({e.name, e.unbiased, e.correlation, e.passes,
                                   !e.half[0].empty() && !e.half[1].empty(), !e.variance.empty(),
                                   e.quarter.size() == 4 && (e.passes == 0 || e.passes >= 4),
                                   history == all.history.end() ? 0 : static_cast<int>(history->second.size()),
                                   std::move(kept), !e.bias.empty(), !e.direct.mean.empty()});
  }
  return available;
}

std::string defaultUnbiased(const AvailableEstimates& available) {
  const auto first = [&](const auto& fits) {
    for (const AvailableEstimate& e : available.estimates)
      if (e.correlation == Correlation::Independent && fits(e)) return e.name;
    return std::string();
  };
  const std::string unbiased = first([](const AvailableEstimate& e) { return e.unbiased; });
  if (!unbiased.empty()) return unbiased;
  return first([](const AvailableEstimate& e) { return e.halves && e.variance && !e.bias && !isMethod(e.name); });
}

}  // namespace braid
