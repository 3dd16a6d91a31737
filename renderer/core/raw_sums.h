// SPDX-License-Identifier: Apache-2.0
// The raw sums of the film as one list. State files are written and read, shares added up, and memory counted by
// walking it, so that each accumulator names its sums in one place.
#pragma once

#include <string>
#include <vector>

#include "renderer/core/plane.h"

namespace braid {

struct RawSum {
  std::string name;  // in state files
  Plane<double>* plane;
  int tile = 1;  // side of the square of pixels that one value is of
};

// In the order of state files.
using RawSums = std::vector<RawSum>;

inline constexpr const char* kChannelSuffixes[] = {".R", ".G", ".B"};

inline void listColour(const std::string& name, Rgb<double>& planes, RawSums& list) {
  for (size_t c = 0; c < 3; ++c) list.push_back({name + kChannelSuffixes[c], &planes[c]});
}

// Adds what `from` lists to what `to` lists: lists of the same names, of one size.
void addSums(const RawSums& to, const RawSums& from);

}  // namespace braid
