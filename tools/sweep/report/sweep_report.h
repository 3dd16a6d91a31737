// SPDX-License-Identifier: Apache-2.0
// Writes what people read of a sweep: plots, summary.md and report.html.
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "tools/sweep/table/sweep_summary.h"

namespace braid {

// Where the image of a method at a rung is kept.
std::string imagePath(const std::string& folder, const std::string& scene, const std::string& method, Ladder ladder,
                      double mark);

// The same for the other seeds.
std::string replicatePath(const std::string& folder, const std::string& scene, const std::string& method, Ladder ladder,
                          double mark, uint64_t seed);

// `record`: sweep.json. Returns warnings, one line each.
std::vector<std::string> writeSweepReport(const std::string& folder, const SweepTable& table,
                                          const SweepSummary& summary, const nlohmann::ordered_json& record,
                                          bool plots);

}  // namespace braid
