// SPDX-License-Identifier: Apache-2.0
// What the methods of uncorrelated weighting share: the groups of quarters, and the search for gamma.
#pragma once

#include <algorithm>
#include <string>

#include "combiners/statistics/variance.h"
#include "combiners/uncorrelated/uncorrelated_filter.h"
#include "combiners/method.h"

namespace braid {

// By what neighbours are left out; see UncorrelatedInputs.
struct NoiseChoice {
  const Rgb<float>* levels = nullptr;
  double most = 0;
};

// What those read that look for a gamma, and the option that sets it: "<method>-gamma".
Needs uncorrelatedNeeds();
OptionInfo gammaOption(const std::string& method);

// Half `values` of both images, combined with weights from the two quarters of half `weights` of the correlated image:
// quarters 0 and 2 make half 0. The halves of the images are used as the means of the pairs of quarters, for they are
// right even if the quarters differ in passes.
UncorrelatedInputs uncorrelatedGroup(const Estimate& y, const Estimate& z, size_t independentHalf,
                                     size_t correlatedHalf, size_t weights, const NoiseChoice& noise = {});

// Makes the halves of the result, one of each group, and notes gamma, which it returns: the option when it is set, or
// else the best one for these groups.
double filterGroups(const MethodInputs& in, const OptionInfo& option, const UncorrelatedInputs (&groups)[2],
                    MethodResult& result);

// The error of an image whose halves are independent and whose bias is negligible: (A - B)² / 4, averaged over channels
// and over 7x7 pixels.
Plane<float> halvesVariance(const Rgb<float> (&halves)[2]);

}  // namespace braid
