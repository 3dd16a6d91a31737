// SPDX-License-Identifier: Apache-2.0
// The text header of state files.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "renderer/film/film_state.h"

namespace braid {

// What the header says of one accumulator's planes and counts.
struct EstimateLayout {
  std::vector<uint64_t> counts;  // passes in each bucket
  uint64_t rejected = 0, clampedSplats = 0;
  bool bias = false, parts = false;
  std::vector<bool> images;  // whether a checkpoint of the history has its image
};

struct StateLayout {
  std::vector<EstimateLayout> estimates;  // as in FilmState
  bool features = false, coverage = false;
  std::array<uint64_t, 2> featurePasses{0, 0};
  uint64_t coveragePasses = 0;
};

// One plane of a file, in the order in which they are stored.
struct PlaneEntry {
  std::string name;
  size_t bytesPerValue = 8;  // 8: float64, 4: float32
};

StateLayout layoutOf(const FilmState& state);

// The plane table that follows from the layout and, for histories, from the state.
std::vector<PlaneEntry> planeTable(const FilmState& state, const StateLayout& layout);

std::string stateHeader(const FilmState& state);

// Reads what stateHeader() wrote into a state without planes. Throws Error(BadInput) that begins with `file`.
void parseStateHeader(const std::string& file, const std::string& text, FilmState& state, StateLayout& layout);

}  // namespace braid
