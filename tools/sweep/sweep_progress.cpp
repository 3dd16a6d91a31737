// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_progress.h"

#include <algorithm>
#include <cstdio>
#include <unistd.h>

#include <fmt/format.h>

#include "tools/run/progress_line.h"

namespace braid {

SweepProgress::SweepProgress(bool quiet)
    : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0), interval_(terminal_ ? 0.25 : 5.0) {}

void SweepProgress::expect(double passes, double seconds) {
  passesExpected_ += passes;
  secondsExpected_ += seconds;
}

void SweepProgress::begin(const std::string& what, double passes, double seconds) {
  what_ = what;
  passesBegun_ = passes;
  secondsBegun_ = seconds;
  passesExpected_ = std::max(0.0, passesExpected_ - passes);
  secondsExpected_ = std::max(0.0, secondsExpected_ - seconds);
  passesNow_ = secondsNow_ = 0;
  begun_.restart();
}

double SweepProgress::secondsLeft() const {
  const double passes = passesDone_ + passesNow_, time = passesTime_ + (passesNow_ > 0 ? begun_.seconds() : 0);
  const double passesLeft = passesExpected_ + passesBegun_ - passesNow_;
  if (passesLeft > 0 && passes <= 0) return -1;
  const double each = passes > 0 ? time / passes : 0;
  return passesLeft * each + secondsExpected_ + std::max(0.0, secondsBegun_ - secondsNow_);
}

void SweepProgress::update(double passes, double seconds, const std::string& detail) {
  passesNow_ = std::min(passes, passesBegun_);
  secondsNow_ = std::min(seconds, secondsBegun_);
  const double now = whole_.seconds();
  if (quiet_ || now - lastPrinted_ < interval_) return;
  lastPrinted_ = now;
  // A log of a night's sweep should not have thousands of lines.
  if (!terminal_) interval_ = std::min(60.0, interval_ * 1.3);
  open_ = terminal_;
  fmt::print(stderr, "{}{}: {}  {}  ETA {}{}", terminal_ ? "\r" : "", what_, detail, formatSeconds(now),
             formatSeconds(secondsLeft()), terminal_ ? "\x1b[K" : "\n");
  std::fflush(stderr);
}

void SweepProgress::end() {
  if (passesBegun_ > 0) {
    passesDone_ += passesNow_;
    passesTime_ += begun_.seconds();
  }
  passesBegun_ = secondsBegun_ = passesNow_ = secondsNow_ = 0;
}

void SweepProgress::breakLine() {
  if (open_) fmt::print(stderr, "\n");
  open_ = false;
}

}  // namespace braid
