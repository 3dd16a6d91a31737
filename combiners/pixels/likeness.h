// SPDX-License-Identifier: Apache-2.0
// Whether pixels lie on the surface of their neighbours, by albedo and normal.
#pragma once

#include "renderer/film/features.h"

namespace braid {

// How unlike two pixels are: half of the squared distances of albedo and normal, in units of what surfaces with noise
// have, 0.25 and 0.15. Above 1.5 they count as of different surfaces.
double unlikeness(const Features& features, size_t i, size_t j);

// 1 for pixels whose 24 neighbours, weighted by nearness, are alike to 0.4 and more by exp(-unlikeness), else 0.
Plane<float> alikePixels(const Features& features);

}  // namespace braid
