// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "renderer/session/integrator.h"

namespace braid {

// What one camera path returns.
struct PathSample {
  Spectrum radiance{0};
  Spectrum direct{0};     // the direct part of it
  float coverage = 1;     // 0 when the camera ray misses everything
  bool onGround = false;  // of a shadow catcher: the radiance says how much of it is in shadow
  FeatureSample features;
};

}  // namespace braid
