// SPDX-License-Identifier: Apache-2.0
// Where samples go: after a pilot of equal passes, tiles get them in proportion to the square root of their relative
// error over their cost (renderer/README.md, Placement of samples). A half of the samples is placed by what the other
// half knows, so that no tile is judged by the samples that the verdict weighs.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "renderer/film/film_state.h"

namespace braid {

// Rounds of the pilot; a map is made after it and whenever the number of rounds has doubled.
inline constexpr uint64_t kPilotRounds = 16;

// The option of states that says who judges; states without it have as many samples in all pixels.
inline constexpr const char* kPlacementOption = "the placement of samples";

// Whether round `round`, counted from 0, begins with a new map.
bool mapIsDue(uint64_t round);

// The squared error of pixels relative to their squared brightness, of an image made of one half (estimatesOfHalf()).
using RelativeErrors = std::function<Plane<float>(const Estimates& half)>;

// Of the samples themselves: the variance over the squared mean of 9 x 9 pixels plus 0.3 of the squared typical
// brightness of tiles, so that lights scaled by a factor change nothing.
Plane<float> varianceOverBrightness(const Estimates& half);

// Sets the weights for the rounds to `2 round`, from the sums of the film after `round` rounds. The gain that it
// predicts: the relative error of as many samples spread evenly over that of the placed ones, at least 1; where it is
// below 1.03 for a half, that half's weights are all 1. A pure function of the sums.
double makePlacementMap(FilmState& film, uint64_t round, const RelativeErrors& errors);

// Samples that pass `pass` gives the pixels of every tile: those of weight w get w a pass on average, evenly spread.
std::vector<int> samplesOfPass(const SamplePlacement& placement, uint64_t pass);

}  // namespace braid
