// SPDX-License-Identifier: Apache-2.0
// Frames of an animation or a turntable: their numbers, their moments, and the files that bear their numbers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace braid {

// Frames first, first + step, … before end.
struct FrameRange {
  uint64_t first = 0, end = 1, step = 1;
  uint64_t count() const { return (end - first + step - 1) / step; }
  uint64_t at(uint64_t i) const { return first + i * step; }
  bool operator==(const FrameRange&) const = default;
};

// A:B or A:B:STEP with A < B. Throws Error(Usage).
FrameRange parseFrames(const std::string& text);

struct FrameChoice {
  std::optional<FrameRange> range;
  double framesPerSecond = 0;  // 0: not said
  uint64_t turntable = 0;      // frames of a turn; 0: the camera stays

  bool any() const { return range || turntable > 0; }
  // The frames to render; only where there are any.
  FrameRange frames() const { return range.value_or(FrameRange{0, turntable, 1}); }
  // Whether frames are moments of the clip: a turntable shows one pose unless --fps is given.
  bool plays() const { return range && (turntable == 0 || framesPerSecond > 0); }
  // Of a frame, in seconds.
  double timeOf(uint64_t frame) const {
    return static_cast<double>(frame) / (framesPerSecond > 0 ? framesPerSecond : kUsualRate);
  }

  static constexpr double kUsualRate = 24;
};

// --frames, --fps and --turntable.
void addFrameRangeOptions(CLI::App& command, FrameChoice& choice);

// `frameTimeGiven`: --frame-time is. Throws Error(Usage) for options that do not go together.
void checkFrames(const FrameChoice& choice, bool frameTimeGiven);

// Whether a file name has a place for a frame's number: # signs, one a digit, or %d or %04d.
bool holdsFrameNumber(const std::string& file);
// The name with the number there, padded with zeros; as it is where it has no place for one.
std::string withFrameNumber(const std::string& file, uint64_t frame);

}  // namespace braid
