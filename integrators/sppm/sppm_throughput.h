// SPDX-License-Identifier: Apache-2.0
// How fast the two halves of photon mapping run by themselves, for benchmarks.
#pragma once

#include "renderer/session/integrator.h"

namespace braid {

struct PhotonThroughput {
  double segmentsPerSecond = 0;  // of light subpaths: a ray, its hit, its BSDF, the next direction
  double queriesPerSecond = 0;   // gather points, all photons within their radii evaluated
  double photonsPerQuery = 0;    // within the radius
  double storedPerPath = 0;
  double sortSeconds = 0;  // to sort the photons of a pass into the grid
};

// Runs pass 0 of the plan on one thread. Times are of that thread's processor time, so that other work on the machine
// does not count.
PhotonThroughput measurePhotonThroughput(const TransportContext& context, const Plan& plan);

}  // namespace braid
