// SPDX-License-Identifier: Apache-2.0
// Noisy images with features, as other renderers make them.
#pragma once

#include "tests/support/combiner_fixture.h"

namespace braid::test::foreign_cases {

inline Case noisyCase(int width = 96, int height = 72, double noise = 1) {
  CaseOptions o;
  o.width = width;
  o.height = height;
  o.noise = noise;
  o.samples = 16;
  return makeCase(o);
}

}  // namespace braid::test::foreign_cases
