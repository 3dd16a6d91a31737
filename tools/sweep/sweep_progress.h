// SPDX-License-Identifier: Apache-2.0
// Progress of many renders on standard error, with the time left of all of them.
#pragma once

#include <string>

#include "renderer/core/stopwatch.h"

namespace braid {

// Work is counted in passes where the number of passes is given and in seconds where the time is; passes of the same
// size are taken to cost the same, which the time left corrects as the sweep goes on.
class SweepProgress {
 public:
  explicit SweepProgress(bool quiet);

  // Adds work to come.
  void expect(double passes, double seconds);
  // Begins a render of so much work.
  void begin(const std::string& what, double passes, double seconds);
  // So much of the render begun is done; `detail` is what the line shows of it.
  void update(double passes, double seconds, const std::string& detail);
  void end();
  // Seconds that the work left will take; negative: not known yet.
  double secondsLeft() const;
  // Ends the line before other output.
  void breakLine();

 private:
  bool quiet_, terminal_, open_ = false;
  double interval_, lastPrinted_ = -1e9;
  std::string what_;
  double passesExpected_ = 0, secondsExpected_ = 0;  // all work not begun
  double passesBegun_ = 0, secondsBegun_ = 0;        // the render begun
  double passesNow_ = 0, secondsNow_ = 0;            // done of it
  double passesDone_ = 0, passesTime_ = 0;           // passes of ended renders and the wall time that they took
  Stopwatch whole_, begun_;
};

}  // namespace braid
