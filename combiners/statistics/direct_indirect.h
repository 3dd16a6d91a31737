// SPDX-License-Identifier: Apache-2.0
// The two parts of an estimate's light as estimates of their own.
//
// Filters that see the parts one by one find neighbours in each that the whole hides: indirect light is smooth across
// the edges of shadows, and direct light, often nearly without noise, need not be blurred for the sake of the other.
// After Zimmer et al. 2015 ("Path-space Motion Estimation and Decomposition for Robust Animation Filtering"), who
// decompose further, by types of scattering.
#pragma once

#include "renderer/film/estimates.h"

namespace braid {

// Whether the estimate knows its direct light, with halves and the variances of both parts.
bool hasDirectIndirect(const Estimate& estimate);

// What denoisers read of the parts: mean, halves, variance, name and passes. The estimate has its parts.
Estimate directLight(const Estimate& estimate);
Estimate indirectLight(const Estimate& estimate);

// Adds mean and halves of one image to those of another.
void addImage(Estimate& to, const Estimate& from);

}  // namespace braid
