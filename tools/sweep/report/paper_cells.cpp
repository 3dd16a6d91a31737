// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/paper_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace braid {

size_t CellComparison::atMost(double limit) const {
  return static_cast<size_t>(
      std::count_if(cells.begin(), cells.end(), [&](const CellRatio& c) { return c.ratio <= limit; }));
}

CellRatio CellComparison::worst() const {
  const auto found = std::max_element(cells.begin(), cells.end(),
                                      [](const CellRatio& a, const CellRatio& b) { return a.ratio < b.ratio; });
  return found == cells.end() ? CellRatio{} : *found;
}

double CellComparison::geometricMean() const {
  double sum = 0;
  for (const CellRatio& c : cells) sum += std::log(c.ratio);
  return cells.empty() ? std::numeric_limits<double>::quiet_NaN() : std::exp(sum / static_cast<double>(cells.size()));
}

double CellComparison::best() const {
  double least = std::numeric_limits<double>::infinity();
  for (const CellRatio& c : cells) least = std::min(least, c.ratio);
  return least;
}

PaperCells::PaperCells(const SweepTable& table, const SweepSummary& summary)
    : table_(table), column_(table.column(summary.errorColumn)), scenes_(summary.scenes) {
  std::map<std::pair<std::string, std::string>, std::map<double, std::pair<double, int>>> sums;
  for (const SweepRow& r : table.rows) {
    if (r.ladder != Ladder::Samples || !std::isfinite(r.values[column_])) continue;
    auto& [sum, count] = sums[{r.scene, r.method}][r.mark];
    sum += r.values[column_];
    ++count;
  }
  for (const auto& [key, marks] : sums)
    for (const auto& [mark, s] : marks) errors_[key][mark] = s.first / s.second;
}

bool PaperCells::has(const std::string& method) const {
  return std::any_of(errors_.begin(), errors_.end(), [&](const auto& e) { return e.first.second == method; });
}

std::optional<double> PaperCells::error(const std::string& scene, const std::string& method, double spp) const {
  const auto found = errors_.find({scene, method});
  if (found == errors_.end()) return {};
  const auto at = found->second.find(spp);
  return at == found->second.end() ? std::optional<double>() : at->second;
}

CellComparison PaperCells::compare(const std::string& method, const std::vector<std::string>& others, double fromSpp,
                                   const Keep& keep, bool lastOnly) const {
  CellComparison c;
  for (const std::string& scene : scenes_) {
    if (keep && !keep(scene)) continue;
    const auto own = errors_.find({scene, method});
    if (own == errors_.end()) continue;
    for (const auto& [spp, value] : own->second) {
      if (spp < fromSpp || (lastOnly && spp != own->second.rbegin()->first)) continue;
      double least = std::numeric_limits<double>::infinity();
      for (const std::string& other : others) {
        const std::optional<double> e = error(scene, other, spp);
        least = e ? std::min(least, *e) : -1;
        if (!e) break;
      }
      if (least > 0 && std::isfinite(least) && value > 0) c.cells.push_back({scene, spp, value / least});
    }
  }
  return c;
}

CellComparison PaperCells::compareAtEqualTime(const std::string& method, const std::string& other,
                                              const Keep& keep) const {
  CellComparison c;
  for (const std::string& scene : scenes_) {
    if (keep && !keep(scene)) continue;
    const Curve own = curveOf(table_, scene, method, Ladder::Samples, column_),
                theirs = curveOf(table_, scene, other, Ladder::Samples, column_);
    if (own.empty() || theirs.empty()) continue;
    const double seconds = std::min(own.back().seconds, theirs.back().seconds);
    const std::optional<double> a = errorAtTime(own, seconds), b = errorAtTime(theirs, seconds);
    if (a && b && *a > 0 && *b > 0) c.cells.push_back({scene, own.back().mark, *a / *b});
  }
  return c;
}

}  // namespace braid
