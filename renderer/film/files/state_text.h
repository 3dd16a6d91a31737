// SPDX-License-Identifier: Apache-2.0
// The text header of state files.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/film_state.h"

namespace braid {

// Of every estimate, which checkpoints of its history hold their image.
using HistoryImages = std::vector<std::vector<bool>>;

// One plane of a file: float64 sums or a float32 image.
struct PlaneEntry {
  std::string name;
  Plane<double>* sum = nullptr;
  Plane<float>* image = nullptr;
  int tile = 1;  // RawSum::tile
  size_t bytesPerValue() const { return sum ? sizeof(double) : sizeof(float); }
  int columns(int width) const { return (width + tile - 1) / tile; }
  // In a file of an image of so many pixels.
  uint64_t bytes(int width, int height) const {
    return bytesPerValue() * static_cast<uint64_t>(columns(width)) * static_cast<uint64_t>(columns(height));
  }
};

// The planes of a state in the order of files. `state` may hold accumulators of no pixels, for files that are about to
// be read.
std::vector<PlaneEntry> planeTable(FilmState& state, const HistoryImages& images);
// To write them: those that the state holds.
std::vector<PlaneEntry> planeTable(const FilmState& state);

std::string stateHeader(const FilmState& state);

// Reads what stateHeader() wrote into a state whose planes have no pixels. Throws Error(BadInput) that begins with
// `file`.
void parseStateHeader(const std::string& file, const std::string& text, FilmState& state, HistoryImages& images);

}  // namespace braid
