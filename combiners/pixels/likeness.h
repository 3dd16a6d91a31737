// SPDX-License-Identifier: Apache-2.0
// Whether pixels lie on the surface of their neighbours, by albedo and normal.
#pragma once

#include "renderer/film/features.h"

namespace braid {

// How unlike two pixels are: half of the squared distances of albedo and normal, in units of what surfaces with noise
// have, 0.25 and 0.15. Above 1.5 they count as of different surfaces.
double unlikeness(const Features& features, size_t i, size_t j);

// Whether the 24 neighbours of a pixel, weighted by nearness, are alike to 0.4 and more by exp(-unlikeness).
bool isAlike(const Features& features, int x, int y);

}  // namespace braid
