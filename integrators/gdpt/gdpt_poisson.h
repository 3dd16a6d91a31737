// SPDX-License-Identifier: Apache-2.0
// Screened Poisson reconstruction: the image that has given gradients as nearly as it can and does not stray from a
// given image (integrators/README.md, Gradient-domain path tracing).
#pragma once

#include "renderer/core/plane.h"

namespace braid {

// Solves (alpha² + L) x = rhs in place. The error is below 10⁻⁷ of the solution for alpha in [0.1, 1], below
// 10⁻⁸ from 0.2 on. Linear in the
// right-hand side: the number of steps does not depend on it. Rhs: any size, at least 1 × 1.
void solveScreenedPoisson(Plane<double>& rhs, double alpha);

}  // namespace braid
