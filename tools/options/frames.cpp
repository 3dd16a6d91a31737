// SPDX-License-Identifier: Apache-2.0
#include "tools/options/frames.h"

#include <charconv>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"

namespace braid {

namespace {

constexpr uint64_t kMostFrames = 1000000;

// Where a name has the number of its frame.
struct NumberPlace {
  size_t begin = std::string::npos, length = 0;
  size_t digits = 1;  // at least
};

NumberPlace findPercent(const std::string& file) {
  for (size_t at = file.find('%'); at != std::string::npos; at = file.find('%', at + 1)) {
    size_t end = at + 1, digits = 0;
    while (end < file.size() && file[end] >= '0' && file[end] <= '9' && end - at < 3)
      digits = 10 * digits + static_cast<size_t>(file[end++] - '0');
    if (end < file.size() && file[end] == 'd') return {at, end + 1 - at, digits};
  }
  return {};
}

// Of the last run of # signs: names of folders may have some as well.
NumberPlace findPlace(const std::string& file) {
  const size_t last = file.rfind('#');
  if (last == std::string::npos) return findPercent(file);
  const size_t before = file.find_last_not_of('#', last);
  const size_t begin = before == std::string::npos ? 0 : before + 1;
  return {begin, last + 1 - begin, last + 1 - begin};
}

}  // namespace

FrameRange parseFrames(const std::string& text) {
  FrameRange range;
  const char *at = text.data(), *end = at + text.size();
  uint64_t* const parts[] = {&range.first, &range.end, &range.step};
  size_t given = 0;
  while (given < 3) {
    const auto [next, error] = std::from_chars(at, end, *parts[given]);
    if (error != std::errc()) break;
    at = next;
    ++given;
    if (at == end || *at != ':' || given == 3) break;
    ++at;
  }
  if (at != end || given < 2 || range.first >= range.end || range.end > kMostFrames || range.step == 0 ||
      text.back() == ':')
    throw Error(ExitCode::Usage, fmt::format("'{}': expected FIRST:END or FIRST:END:STEP such as 0:24, frames from 0 "
                                             "to {}, END excluded",
                                             text, kMostFrames));
  return range;
}

void addFrameRangeOptions(CLI::App& command, FrameChoice& choice) {
  addParsed(command, "--frames", choice.range, parseFrames,
            "Frames of an animation, END excluded: frame n shows the time n / fps; # signs in names of files become n")
      ->type_name("FIRST:END[:STEP]");
  command.add_option("--fps", choice.framesPerSecond, "Frames a second (default: 24)")
      ->check(number(0, 1e6, Ends::LeastExcluded));
  command
      .add_option("--turntable", choice.turntable,
                  "Turn the camera about the scene's vertical axis once in so many frames; with --fps it also plays")
      ->check(wholeNumber(1, kMostFrames));
}

void checkFrames(const FrameChoice& choice, bool frameTimeGiven) {
  if (!choice.any() && choice.framesPerSecond > 0)
    throw Error(ExitCode::Usage, "--fps: give --frames FIRST:END, which frames to render");
  if (choice.framesPerSecond > 0 && !choice.range)
    throw Error(ExitCode::Usage, "--fps: give --frames FIRST:END too, or leave it out: a turntable shows one pose");
  if (choice.plays() && frameTimeGiven)
    throw Error(ExitCode::Usage, "--frames and --frame-time: frames have their own times: leave --frame-time out");
}

bool holdsFrameNumber(const std::string& file) { return findPlace(file).length > 0; }

std::string withFrameNumber(const std::string& file, uint64_t frame) {
  const NumberPlace place = findPlace(file);
  if (place.length == 0) return file;
  return file.substr(0, place.begin) + fmt::format("{:0{}}", frame, place.digits) +
         file.substr(place.begin + place.length);
}

}  // namespace braid
