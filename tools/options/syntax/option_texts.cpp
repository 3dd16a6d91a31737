// SPDX-License-Identifier: Apache-2.0
#include "tools/options/syntax/option_texts.h"

#include <charconv>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr double kLongestDuration = 1e9;  // seconds: 31 years
constexpr int kMostPixelsASide = 65536;

[[noreturn]] void refuseText(const std::string& text, const std::string& expected) {
  throw Error(ExitCode::Usage, fmt::format("'{}': expected {}", text, expected));
}

// Numbers with the separators between them and nothing else; false otherwise.
template <class T>
bool readNumbers(const std::string& text, const std::string& separators, std::vector<T>& numbers) {
  const char *at = text.data(), *end = at + text.size();
  for (size_t i = 0;; ++i) {
    T value{};
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc()) return false;
    numbers.push_back(value);
    if (i == separators.size()) return next == end;
    if (next == end || *next != separators[i]) return false;
    at = next + 1;
  }
}

}  // namespace

std::vector<std::string> splitList(const std::string& text) {
  std::vector<std::string> list;
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) list.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return list;
}

std::string joinList(const std::vector<std::string>& items) { return fmt::format("{}", fmt::join(items, ",")); }

double parseDuration(const std::string& text) {
  double total = 0;
  const char *at = text.data(), *end = at + text.size();
  bool valid = at < end;
  while (valid && at < end) {
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    valid = error == std::errc() && std::isfinite(value) && value >= 0;
    const char unit = next < end ? *next : 's';
    total += value * (unit == 'h' ? 3600 : unit == 'm' ? 60 : 1);
    at = next < end && (unit == 'h' || unit == 'm' || unit == 's') ? next + 1 : next;
  }
  if (!valid || !(total <= kLongestDuration))
    refuseText(text, "a duration such as 90, 90s, 2m, 1h or 1h30m, of at most 1e9 seconds");
  return total;
}

std::vector<double> parseNumbers(const std::string& text, size_t count, double least, double most) {
  std::vector<double> numbers;
  bool valid = readNumbers(text, std::string(count - 1, ','), numbers);
  for (const double n : numbers) valid = valid && n >= least && n <= most;
  if (!valid) refuseText(text, fmt::format("{} numbers from {:g} to {:g}, separated by commas", count, least, most));
  return numbers;
}

double parseLimit(const std::string& text) {
  const double seconds = parseDuration(text);
  if (!(seconds > 0)) refuseText(text, "a duration above 0, such as 90, 90s, 2m or 1h30m");
  return seconds;
}

FrameSize parseSize(const std::string& text) {
  std::vector<int> size;
  const bool valid = readNumbers(text, "x", size) && size[0] > 0 && size[1] > 0 && size[0] <= kMostPixelsASide &&
                     size[1] <= kMostPixelsASide && int64_t(size[0]) * size[1] <= (int64_t(1) << 28);
  if (!valid)
    refuseText(text, "WIDTHxHEIGHT such as 1280x720, from 1 to 65536 pixels a side and at most 268435456 in all");
  return {size[0], size[1]};
}

std::string toString(const FrameSize& size) { return fmt::format("{}x{}", size.width, size.height); }

LookAt parseLookAt(const std::string& text) {
  const std::vector<double> n = parseNumbers(text, 6, -1e15, 1e15);
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
}

std::optional<double> parseExposure(const std::string& text) {
  constexpr double kMostStops = 64;
  std::vector<double> n;
  if (text == "auto") return {};
  if (!readNumbers(text, "", n) || !(std::abs(n[0]) <= kMostStops))
    refuseText(text, "auto, or a number of stops from -64 to 64");
  return n[0];
}

Aperture parseAperture(const std::string& text) {
  const bool isNumber = text.rfind("f/", 0) == 0;
  std::vector<double> n;
  if (!readNumbers(isNumber ? text.substr(2) : text, "", n) || !(n[0] > 0) || !(n[0] <= 1e9))
    refuseText(text, "an f-number such as f/2.8, or metres such as 0.02, above 0 to 1e9");
  return isNumber ? Aperture{n[0], 0} : Aperture{0, n[0]};
}

Focus parseFocus(const std::string& text) {
  if (text.find(',') != std::string::npos) return {0, parsePixel(text)};
  std::vector<double> n;
  if (!readNumbers(text, "", n) || !(n[0] > 0) || !(n[0] <= 1e15))
    refuseText(text, "metres above 0 to 1e15, or a pixel X,Y");
  return {n[0], std::nullopt};
}

Spectrum parseBackground(const std::string& text) {
  const std::vector<double> n = parseNumbers(text, 3, 0, 1e20);  // what floats hold with room to spare
  return Spectrum(n[0], n[1], n[2]);
}

PixelWindow parseWindow(const std::string& text) {
  std::vector<int> n;
  const bool valid = readNumbers(text, ",,,", n) && n[0] >= 0 && n[1] >= 0 && n[0] < n[2] && n[1] < n[3] &&
                     n[2] <= kMostPixelsASide && n[3] <= kMostPixelsASide;
  if (!valid)
    refuseText(text, "x0,y0,x1,y1: 4 numbers from 0 to 65536, the window's ends (excluded) above its beginnings");
  return {n[0], n[1], n[2], n[3]};
}

std::pair<int, int> parsePixel(const std::string& text) {
  std::vector<int> n;
  const bool valid =
      readNumbers(text, ",", n) && n[0] >= 0 && n[1] >= 0 && n[0] < kMostPixelsASide && n[1] < kMostPixelsASide;
  if (!valid) refuseText(text, "X,Y from 0,0 to 65535,65535");
  return {n[0], n[1]};
}

PassInterval parsePasses(const std::string& text) {
  std::vector<uint64_t> n;
  if (!readNumbers(text, ":", n) || n[0] >= n[1] || n[1] > kMaxPass)
    refuseText(text, fmt::format("FIRST:END such as 0:256, passes from 0 to {}, END excluded", kMaxPass));
  return {n[0], n[1]};
}

}  // namespace braid
