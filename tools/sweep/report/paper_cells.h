// SPDX-License-Identifier: Apache-2.0
// Mean errors of a sweep's methods by scene and samples, and comparisons over all cells that two methods share.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/sweep/table/sweep_summary.h"

namespace braid {

// The error of one method over another's in one cell.
struct CellRatio {
  std::string scene;
  double spp = 0, ratio = 0;
};

// Ratios over a set of cells.
struct CellComparison {
  std::vector<CellRatio> cells;
  size_t atMost(double limit) const;  // how many ratios are not above it
  CellRatio worst() const;            // none: an empty scene
  double geometricMean() const;       // NaN for no cells
  double best() const;                // the smallest ratio
};

class PaperCells {
 public:
  using Keep = std::function<bool(const std::string& scene)>;

  // Of the ladder of samples; means over seeds of the summary's error column.
  PaperCells(const SweepTable& table, const SweepSummary& summary);

  const std::vector<std::string>& scenes() const { return scenes_; }
  bool has(const std::string& method) const;
  std::optional<double> error(const std::string& scene, const std::string& method, double spp) const;

  // The method's error over the smallest one of the others, in cells of at least `fromSpp` where all have one; with
  // `lastOnly` in the last rung's cells only.
  CellComparison compare(const std::string& method, const std::vector<std::string>& others, double fromSpp,
                         const Keep& keep = {}, bool lastOnly = false) const;
  // At the end of the shorter of the two curves over time.
  CellComparison compareAtEqualTime(const std::string& method, const std::string& other, const Keep& keep = {}) const;

 private:
  const SweepTable& table_;
  size_t column_;
  std::vector<std::string> scenes_;
  std::map<std::pair<std::string, std::string>, std::map<double, double>> errors_;  // by scene and method, spp
};

}  // namespace braid
