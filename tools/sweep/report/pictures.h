// SPDX-License-Identifier: Apache-2.0
// Pictures for the report: tone-mapped images, false-colour errors, crops, and their encoding into a page.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/film/film.h"

namespace braid {

// 8-bit sRGB, row-major.
struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

// A factor that brings the 95th percentile of the reference's luminance to 0.8 before the tone curve; 1 for a black
// one.
float exposureOf(const Rgb<float>& reference);

// ACES curve and sRGB of the image times the exposure, as the metrics do; non-finite pixels are magenta.
Picture toneMapped(const Rgb<float>& image, float exposure);

// Errors on a logarithmic scale from `lo` (dark) to `hi` (bright).
Picture falseColour(const Plane<double>& errors, double lo, double hi);
// The scale's colours from left to right.
Picture colourBar(int width, int height);

// Averages blocks so that the width is at most `maxWidth`; unchanged when it is.
Rgb<float> shrunk(const Rgb<float>& image, int maxWidth);
Plane<double> shrunk(const Plane<double>& plane, int maxWidth);

Rgb<float> cropped(const Rgb<float>& image, const PixelWindow& window);
Plane<double> cropped(const Plane<double>& plane, const PixelWindow& window);

// The square of that size whose errors are largest, single pixels counting no more than the 99th percentile.
PixelWindow worstWindow(const Plane<double>& errors, int size);

// "data:image/png;base64,…", or JPEG for pictures of more than 256 × 256 pixels.
std::string dataUri(const Picture& picture);
std::string base64(const std::string& bytes);

}  // namespace braid
