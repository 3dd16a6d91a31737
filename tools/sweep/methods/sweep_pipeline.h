// SPDX-License-Identifier: Apache-2.0
// Denoisers and combiners as methods of a sweep.
#pragma once

#include <string>
#include <vector>

#include "combiners/method.h"
#include "tools/sweep/methods/sweep_method.h"

namespace braid {

// The methods of these names: integrators, and denoisers and combiners in the forms that combine plans know (combiners/
// combine plan.h), of the estimate of pt or of another integrator named before a slash: nfor, js, js@sppm, bdpt/nfor;
// or of several, of which the first is improved: bdpt+sppm/auto. An integrator after '@' is rendered too, and the first
// registered one with correlated pixels for methods that need it. Methods of the same inputs run together, so that each
// denoiser runs once a snapshot; their seconds still count it for every method that reads it. Throws Error(Usage)
// naming unknown names and what keeps a method from running. `numbers` are values of the methods' options. "auto"
// before a slash stands for what the plan keeps of a scene, `planned`, joined by '+'.
std::vector<SweepMethod> sweepMethods(const std::vector<std::string>& names,
                                      const std::vector<const Integrator*>& integrators,
                                      const MethodOptions& numbers = {}, const std::string& planned = "pt");

}  // namespace braid
