// SPDX-License-Identifier: Apache-2.0
// The filter of the maps of variances and risks that convergence curves are read off.
#pragma once

#include <array>

#include "renderer/core/plane.h"

namespace braid {

// The Gaussian of gaussianFiltered() (sure_map.h), in which pixels may count in units of their own squared level.
//
// What is wrong with a denoised image in dark pixels is nothing beside the noise of a lamp or of its mirror image among
// them. In units of level² + 0.01 every pixel of the window counts by its relative error. The level is that of the
// denoised image: units that know the noise would hide it.
//
// 121 pixels do not distinguish a small risk from 0. The ratio of risk to variance over 41x41 pixels does, but is not
// everywhere the same. Pooled risks start from it and keep of the difference d to the mean of the 121 what their
// scatter s² leaves standing, d max(0, 1 - 3 s² / (121 d²)).
class SureMapFilter {
 public:
  // `level`: null counts pixels as they are.
  SureMapFilter(double sigma, const Rgb<float>* level, bool pooled);
  // Of squares of radiances.
  Rgb<float> operator()(const Rgb<float>& map) const;
  // The filtered map of risks without negative values: pooled, or by the sign rule (applySignRule()).
  Rgb<float> risk(Rgb<float> sure, const Rgb<float>& variance) const;

 private:
  Plane<float> pooledRisk(const Plane<float>& sure, const Plane<float>& variance) const;
  // Squares of radiances in units of the pixel, and back.
  Rgb<float> toUnits(Rgb<float> map) const;
  Rgb<float> fromUnits(Rgb<float> map) const;

  double sigma_;
  bool pooled_;
  std::array<Plane<float>, 3> unit_;  // or empty
};

}  // namespace braid
