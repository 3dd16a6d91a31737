// SPDX-License-Identifier: Apache-2.0
// The patch-Welch filter (combiners/README.md, Patch-Welch filter): a neighbour is averaged in as far as the difference
// of the two means is explained by the variances of the means, tested over a patch. For the pixels p and q = p + d:
//   z²(p) = mean over RGB of (u_p - u_q)² / (V_p + V_q),      s = mean of z² over 3 x 3 pairs at the same d,
//   w     = max(0, 1 - s / t²)² exp(-|d|² / 50 - edge terms of albedo and normal),
// clipped at the borders, and 0 between pixels where every ray has missed the scene and pixels with hits. t is the
// threshold z as a quantile of Student's distribution with 2n - 2 degrees of freedom. V falls as 1/n, hence a neighbour
// that differs at all is left out in the end: the filter is consistent.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "combiners/denoise/pw/pw_neighbours.h"
#include "combiners/denoise/pw/pw_tile.h"
#include "combiners/denoise/pw/pw_weights.h"
#include "renderer/core/plane.h"

namespace braid {

inline constexpr double kPatchWelchThreshold = 1.6;      // of pw: for few samples
inline constexpr double kPatchWelchWideThreshold = 2.2;  // of pw-wide and pw1: smoother
// Of the spatial Gaussian, in pixels.
inline constexpr double kPatchWelchSpatialSd = 5;
// Keeps 0/0 away and nothing else, so that results scale with the light.
inline constexpr float kPatchWelchEpsilon = 1e-30f;

// The t >= 0 with P(T <= t) = Φ(z) for Student's T with `dof` > 0 degrees of freedom; z >= 0. Exact for even dof.
double studentQuantile(double z, uint64_t dof);

// t² for the threshold z and estimates of `passes` >= 2 passes.
float squaredThreshold(double z, uint64_t passes);

struct TileSize {
  int width = 256, height = 32;
};

// Filters each image of `input` with its own weights, for each threshold, in one pass over the distances: result[k][i]
// is images[i] with threshold z = thresholds[k], at least one. Deterministic; the size of the tiles changes no bit.
// Once `cancel` is set, tiles stay black. `kept`, if any, gets the weights of its pixels, of the only threshold; it was
// made for these neighbours.
std::vector<std::vector<Rgb<float>>> patchWelch(const PatchWelchInput& input, std::span<const double> thresholds,
                                                const PatchWelchNeighbours& neighbours = {}, TileSize tiles = {},
                                                const std::atomic<bool>* cancel = nullptr,
                                                PatchWelchWeights* kept = nullptr);

}  // namespace braid
