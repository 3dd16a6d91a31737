// SPDX-License-Identifier: Apache-2.0
// The filter of the maps of variances and risks that convergence curves are read off.
#pragma once

#include <array>

#include "renderer/core/plane.h"

namespace braid {

// The Gaussian of gaussianFiltered() (sure_map.h), in which pixels may count in units of their own squared level.
//
// What is wrong with a denoised image in dark pixels is nothing beside the noise of a lamp or of its mirror image among
// them. In units of level² + 0.01 (of images of order 1) every pixel of the window counts by its relative error, as in
// relL2. The level is that of the denoised image: units that know the noise would hide it.
class MapFilter {
 public:
  // `level`: null counts pixels as they are.
  MapFilter(double sigma, const Rgb<float>* level);
  // Of squares of radiances.
  Rgb<float> operator()(const Rgb<float>& map) const;
  // The filtered map of risks without negative values by the sign rule (applySignRule()).
  Rgb<float> risk(Rgb<float> sure, const Rgb<float>& variance) const;

 private:
  // Squares of radiances in units of the pixel, and back.
  Rgb<float> toUnits(Rgb<float> map) const;
  Rgb<float> fromUnits(Rgb<float> map) const;

  double sigma_;
  std::array<Plane<float>, 3> unit_;  // or empty
};

}  // namespace braid
