// SPDX-License-Identifier: Apache-2.0
// The transfer function of Open Image Denoise for light without bound: the perceptually uniform encoding of Aydin,
// Mantiuk and Seidel 2008 for radiance of order 1, in three pieces, scaled so that the largest half float becomes 1.
#pragma once

namespace braid {

// Radiance beyond it is limited to it.
inline constexpr float kOidnMostRadiance = 65504;

// Of [0, kOidnMostRadiance] to [0, 1]; negative values and such that are no number count as 0.
float oidnEncoded(float radiance);
// The inverse. Finite for any value.
float oidnDecoded(float value);

}  // namespace braid
