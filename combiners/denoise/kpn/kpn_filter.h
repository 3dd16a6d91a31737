// SPDX-License-Identifier: Apache-2.0
// The kernels of kpn: averages over 5x5 pixels at several scales, joined from the coarsest on (formulas in
// combiners/README.md, Kernel prediction).
#pragma once

#include <array>
#include <vector>

#include "renderer/core/plane.h"

namespace braid {

inline constexpr int kKpnLevels = 6;          // each of half the resolution of the one before
inline constexpr int kKpnFineFeatures = 6;    // of pixels, besides their weight and gate
inline constexpr int kKpnCoarseFeatures = 8;  // of the other levels, besides their gate
inline constexpr int kKpnFineOutputs = kKpnFineFeatures + 2, kKpnCoarseOutputs = kKpnCoarseFeatures + 1;
// Of the network, for 2x2 pixels: each fine output of the four, row by row, then those of the other levels.
inline constexpr int kKpnOutputs = 4 * kKpnFineOutputs + (kKpnLevels - 1) * kKpnCoarseOutputs;

// Up to how much noise, in squared standard deviations, a difference counts as noise, and how steeply weights fall
// beyond, so that neither kernels nor gates keep pixels together that differ for sure.
struct KpnTests {
  std::array<float, kKpnLevels> steepness{}, tolerance{};          // of neighbours
  std::array<float, kKpnLevels> gateSteepness{}, gateTolerance{};  // of the level below
};

// What the network says of each level; each is half as wide and high as the one before, rounded up.
struct KpnFeatures {
  std::array<std::vector<Plane<float>>, kKpnLevels> level;
};

// Planes for an image of this size; of the level 1 to the last all in the resolution of level 1 until joined.
KpnFeatures kpnFeatures(int width, int height);
// Averages what the network said at the resolution of level 1 to that of each coarser one.
void shrinkToLevels(KpnFeatures& features);

// Linear in the irradiance for given features, variance and brightness. The weights of a pixel's kernel sum to 1.
Rgb<float> kpnFiltered(const Rgb<float>& irradiance, const Plane<float>& variance, const KpnFeatures& features,
                       const KpnTests& tests);

}  // namespace braid
