// SPDX-License-Identifier: Apache-2.0
// Sweeps that are asked for by name.
#pragma once

#include <set>
#include <string>

#include "tools/sweep/sweep.h"

namespace braid {

// Fills in what the preset stands for, but for the options in `given`, named as on the command line. `papers`: the
// comparisons of the five papers behind the combiners. Throws Error(Usage) naming an unknown preset and the known ones.
void applyPreset(const std::string& preset, const std::set<std::string>& given, SweepOptions& options);

}  // namespace braid
