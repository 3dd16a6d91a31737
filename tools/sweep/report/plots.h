// SPDX-License-Identifier: Apache-2.0
// Convergence plots by gnuplot: a data file and a script each, kept so that anybody can change and run them again.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tools/sweep/table/sweep_summary.h"

namespace braid {

struct Plot {
  std::string name;  // of the files, without extension: letters, digits, '.', '_', '-'
  std::string title, xLabel, yLabel;
  bool versusSeconds = false;                         // else against samples
  std::vector<std::pair<std::string, Curve>> series;  // the first one anchors the guide of slope -1
};

// Writes NAME.dat and NAME.gp into the folder. Log-log, a band from the lowest to the highest seed where they differ.
void writePlotFiles(const std::string& folder, const Plot& plot);

// Runs `gnuplot NAME.gp` in the folder, which writes NAME.svg and NAME.png. Returns an empty string or why it failed.
std::string runGnuplot(const std::string& folder, const std::string& name);

}  // namespace braid
