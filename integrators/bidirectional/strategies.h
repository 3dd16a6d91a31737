// SPDX-License-Identifier: Apache-2.0
// The weighted image of every way (s, t) in which bidirectional path tracing finds light: together they are the render.
#pragma once

#include <vector>

#include "integrators/bidirectional/bidirectional.h"

namespace braid {

// s vertices from the light, t from the camera (itself included).
struct StrategyImage {
  int s = 0, t = 0;
  Rgb<float> mean;  // over the passes
};

// Renders `passes` passes of `bdpt` from pass 0 and returns the strategies that contributed, by s, then t. Their sum is
// the mean of bdpt's passes with the same plan, but for the rounding of fixed-point sums.
std::vector<StrategyImage> renderStrategies(const TransportContext& context, const Plan& plan, uint64_t passes);

// One pass of bdpt; the observer may hear from several threads at once.
bool renderBidirectionalPass(const PassRequest& request, PassTarget& target, StrategyObserver* observer);

// Renders one pixel of a pass alone, for replays.
void replayBidirectionalPixel(const PassRequest& request, int x, int y, StrategyObserver& observer);

}  // namespace braid
