// SPDX-License-Identifier: Apache-2.0
// Image metrics: a table of per-pixel errors, each with a name, a description and the way from the mean error to the
// reported value.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/core/plane.h"

namespace braid {

struct Metric {
  const char* name;
  const char* description;
  bool largerIsBetter;
  // One error a pixel, >= 0. Both images are finite and of one size.
  Plane<double> (*errors)(const Rgb<float>& image, const Rgb<float>& reference);
  // From the mean of the errors to the value; null: the mean itself.
  double (*finish)(double meanError);
};

struct MetricResult {
  double value = 0;
  uint64_t excluded = 0;  // pixels left out because the reference is not finite there
  uint64_t invalid = 0;   // pixels where the image is not finite although the reference is: the error is infinite then
};

// All metrics, in the order in which they are printed.
const std::vector<Metric>& metricRegistry();

// By name, in any case of letters; null when there is none.
const Metric* findMetric(const std::string& name);

// `trimPercent` of the pixels, those with the largest errors, are left out of the mean: fireflies and misplaced edges,
// as the caller must say when reporting it. Sizes have to be equal.
MetricResult evaluate(const Metric& metric, const Rgb<float>& image, const Rgb<float>& reference,
                      double trimPercent = 0);

// The value alone. Throws Error(Usage) for an unknown name.
double metric(const std::string& name, const Rgb<float>& image, const Rgb<float>& reference);

// (1 - SSIM) / 2 of each pixel, averaged over the channels of the tone-mapped images.
Plane<double> dssimErrors(const Rgb<float>& image, const Rgb<float>& reference);

// HDR-FLIP of each pixel: the maximum over exposures.
Plane<double> hdrFlipErrors(const Rgb<float>& image, const Rgb<float>& reference);

// LDR-FLIP of each pixel, for display colours in [0, 1], linear Rec. 709.
Plane<float> ldrFlip(const Rgb<float>& image, const Rgb<float>& reference, float pixelsPerDegree = 67.0206f);

// Exposures in stops at which HDR-FLIP compares, from the luminances of the reference.
std::vector<float> flipExposures(const Rgb<float>& reference);

}  // namespace braid
