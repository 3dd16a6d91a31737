// SPDX-License-Identifier: Apache-2.0
// Values of options that are written as texts: lists, sizes, windows, durations. All throw Error(Usage) with what is
// expected; the command line puts the option's name before it.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/film/film_state.h"

namespace braid {

// The items between commas, without empty ones; and back.
std::vector<std::string> splitList(const std::string& text);
std::string joinList(const std::vector<std::string>& items);

// Seconds, at most 1e9, from `90`, `90s`, `2m`, `1h` or a sum such as `1h30m`.
double parseDuration(const std::string& text);

// `count` numbers between commas, each within [least, most].
std::vector<double> parseNumbers(const std::string& text, size_t count, double least, double most);

// The same, more than nothing.
double parseLimit(const std::string& text);

struct FrameSize {
  int width = 0, height = 0;
  bool operator==(const FrameSize&) const = default;
};
// WIDTHxHEIGHT: at most 65536 pixels a side and 2^28 in all.
FrameSize parseSize(const std::string& text);
std::string toString(const FrameSize& size);

struct LookAt {
  glm::dvec3 eye{0}, target{0};
};
// ox,oy,oz,tx,ty,tz.
LookAt parseLookAt(const std::string& text);

// `auto` (none), or stops from -64 to 64.
std::optional<double> parseExposure(const std::string& text);

// The width of a lens: f/N, N times smaller than its focal length behind a frame 24 mm high, or in metres.
struct Aperture {
  double fNumber = 0;  // 0: `metres`
  double metres = 0;
};
Aperture parseAperture(const std::string& text);

// What is sharp: metres along the view, or what pixel X,Y sees.
struct Focus {
  double metres = 0;
  std::optional<std::pair<int, int>> pixel;
};
Focus parseFocus(const std::string& text);

// r,g,b, none of them negative.
Spectrum parseBackground(const std::string& text);

// x0,y0,x1,y1 with x0 < x1 and y0 < y1.
PixelWindow parseWindow(const std::string& text);

// X,Y.
std::pair<int, int> parsePixel(const std::string& text);

// FIRST:END with FIRST < END.
PassInterval parsePasses(const std::string& text);

}  // namespace braid
