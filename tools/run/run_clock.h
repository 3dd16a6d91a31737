// SPDX-License-Identifier: Apache-2.0
// The wall clock of the whole process: what a user waits for, from the start of the program to its last file.
#pragma once

#include <algorithm>
#include <limits>

namespace braid {

// Seconds since the process started, loading of its libraries included.
double processSeconds();

// A limit of the whole process, or of what began at `began` by its clock; none where `seconds` is 0.
class TimeLimit {
 public:
  // What an image that is being combined may take beyond the limit before it is given up: nearly done, it is worth
  // more than the seconds.
  static constexpr double kGrace = 0.75, kGraceShare = 0.02;

  explicit TimeLimit(double seconds = 0, double began = 0) : seconds_(seconds), began_(began) {}
  bool exists() const { return seconds_ > 0; }
  double seconds() const { return seconds_; }
  // Seconds from now, negative when it is over; infinite without a limit.
  double left() const {
    return exists() ? began_ + seconds_ - processSeconds() : std::numeric_limits<double>::infinity();
  }
  double grace() const { return std::max(kGrace, kGraceShare * seconds_); }

 private:
  double seconds_, began_;
};

// Where the seconds of a render went; one after the other, so that they add up to `total`.
struct RunTimes {
  double load = 0, prepare = 0, hierarchy = 0;  // reading the scene, and building it
  double start = 0;                             // the program itself, the plan and the film
  double render = 0, combine = 0, write = 0;    // write: what files are made of, too
  double total = 0;                             // from the start of the process until now

  double beforeRender() const { return start + load + prepare + hierarchy; }
};

}  // namespace braid
