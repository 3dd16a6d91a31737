// SPDX-License-Identifier: Apache-2.0
// What the five papers behind the combiners claim, and what a sweep measured of it: the report of `--preset papers`.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tools/sweep/report/replicates.h"
#include "tools/sweep/table/sweep_summary.h"

namespace braid {

struct PaperClaim {
  std::string claim, measured;
  std::optional<bool> holds;  // none: the sweep has no rows to tell
};

struct PaperSection {
  std::string title;
  std::vector<PaperClaim> claims;
};

// One section a paper and one of the combiner `auto`, over the ladder of samples, means over seeds; claims without rows
// say so. `planned`: of each scene the integrators that `auto` keeps for it, joined by '+'.
std::vector<PaperSection> comparePapers(const SweepTable& table, const SweepSummary& summary,
                                        const std::vector<ReplicateBias>& biases,
                                        const std::map<std::string, std::string>& planned);

// What a sweep has to measure for them: with networks where they run here.
std::vector<std::string> paperMethods();

// Whether a sweep has methods that the sections are about.
bool knowsPapers(const SweepSummary& summary);

std::string toMarkdown(const std::vector<PaperSection>& sections);
std::string toHtml(const std::vector<PaperSection>& sections);

}  // namespace braid
