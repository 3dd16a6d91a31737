// SPDX-License-Identifier: Apache-2.0
// Values of options that are written as texts: lists, sizes, windows, durations. All throw Error(Usage) with what is
// expected; the command line puts the option's name before it.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "renderer/film/film_state.h"

namespace braid {

// The items between commas, without empty ones.
std::vector<std::string> splitList(const std::string& text);

// Seconds, at most 1e9, from `90`, `90s`, `2m`, `1h` or a sum such as `1h30m`.
double parseDuration(const std::string& text);

// `count` numbers between commas, each within [least, most].
std::vector<double> parseNumbers(const std::string& text, size_t count, double least, double most);

// WIDTHxHEIGHT: at most 65536 pixels a side and 2^28 in all.
std::pair<int, int> parseSize(const std::string& text);

// x0,y0,x1,y1 with x0 < x1 and y0 < y1.
PixelWindow parseWindow(const std::string& text);

// X,Y.
std::pair<int, int> parsePixel(const std::string& text);

// FIRST:END with FIRST < END.
PassInterval parsePasses(const std::string& text);

}  // namespace braid
