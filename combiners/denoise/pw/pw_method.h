// SPDX-License-Identifier: Apache-2.0
// What the methods around the patch-Welch filter share.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/method.h"

namespace braid {

// All of them work without features, and without the variance if there are halves.
Needs patchWelchNeeds();

// The input of a method. Throws Error(BadInput) when nothing is known of the noise.
PatchWelchInput patchWelchInputOf(const MethodInputs& in, const std::string& method);

// The threshold option of a method, "<method>-threshold", and its value, kept in the option's range.
OptionInfo thresholdOption(const std::string& method, double fallback);
double thresholdOf(const MethodInputs& in, const OptionInfo& option);

// The filtered images, and halves where there are any, as a result.
MethodResult patchWelchResult(std::vector<Rgb<float>> images);

// The filter as a method; its threshold is the option "<name>-threshold".
std::unique_ptr<Method> patchWelchMethod(const std::string& name, const std::string& description, double threshold);

}  // namespace braid
