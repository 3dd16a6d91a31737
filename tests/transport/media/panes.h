// SPDX-License-Identifier: Apache-2.0
// A pane of clear glass.
#pragma once

#include "tools/bench/builtin_scenes.h"

namespace braid::test::panes {

inline Material pane(const Spectrum& color = Spectrum(1), float roughness = 0, float transmission = 1) {
  Material m = diffuseMaterial(color);
  m.specular = 1;
  m.roughness = roughness;
  m.transmission = transmission;
  return m;
}

}  // namespace braid::test::panes
