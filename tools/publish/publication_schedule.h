// SPDX-License-Identifier: Apache-2.0
// When a running render shows what it has: after the rounds 1, 2, 4, 8, …, and every so many seconds, but never so
// often that showing takes more than its share of the time. With a target of the error it also looks at the finished
// image after 16, 32, 64, … rounds, whatever that costs: a run ends with the same samples on every machine.
//
// With combiners the first image out is the plain one. Combined ones replace it as soon as they are affordable, the
// last one of the run included, and one that turns out to be too long is given up.
#pragma once

#include <cstdint>
#include <optional>

#include "renderer/session/session.h"

namespace braid {

class PublicationSchedule {
 public:
  // Of the time of a run, what combining may take, and what plain images and states after rounds 1, 2, 4, … may take;
  // what the clock asks for apart.
  static constexpr double kShare = 0.04, kPlainShare = 0.015;
  // A run that ends so soon, in seconds, has its final images soon: only the clock asks for more.
  static constexpr double kSoon = 1;
  // Runs without a limit count as at least so long for the first plain image and for giving up a combiner, in seconds.
  static constexpr double kLeastRun = 50;
  // Before so many samples a pixel an error estimate does not end a render: what is rare may not have been met yet.
  static constexpr uint64_t kLeastSamples = 16;

  // What an image is expected to cost until that is known, in seconds of the whole machine.
  struct Costs {
    double plain = 0, combined = 0;
  };

  // `saveEvery` in seconds, 0: never by the clock; `targetError` 0: none; `combines`: whether combiners run.
  PublicationSchedule(double saveEvery, double targetError, bool combines, const Costs& expected)
      : saveEvery_(saveEvery), targetError_(targetError), combines_(combines), cost_(expected) {}

  struct Due {
    bool state = false, image = false;
    bool combined = false;  // the image goes through the combiners
  };
  // What to do after this round.
  Due due(const Progress& progress) const;
  // Whether the error of the image of this round has to be known, for it may end the run.
  bool looksAt(const Progress& progress) const;

  // What was begun of it. Costs are in seconds of the whole machine.
  void begun(const Due& what, const Progress& progress);
  void spend(double cost) { plainSpent_ += cost; }
  // An image is out: its samples, what it cost, and its estimated error where that is known and meant by the target.
  // Combining for nothing is saved where the target is far: the error is taken to fall with the square of the number of
  // samples at most (a mean's falls with the number).
  void published(uint64_t samples, bool combined, double cost, std::optional<double> error);
  // Whether the combined image at work, with this cost so far, has to be given up.
  bool tooLong(const Progress& progress, double cost) const;
  void givenUp(double cost);

  // What everything that is out or was given up has cost, in seconds of the whole machine.
  double spent() const { return plainSpent_ + combinedSpent_; }

  // What an image costs: what the last one did, or else what is expected on a machine that has nothing else to do,
  // `slowdown` times.
  double cost(bool combined, double slowdown) const {
    return combined ? cost_.combined * (combinedKnown_ ? 1 : slowdown) : cost_.plain * (plainKnown_ ? 1 : slowdown);
  }

 private:
  static double lengthOfRun(const Progress& progress, double least);
  // With the last image of the run, unless it ends with the one that this cost is for.
  double withLast(double cost) const { return targetError_ > 0 ? cost : 2 * cost; }

  double saveEvery_, targetError_;
  bool combines_;
  double lastImage_ = 0, lastState_ = 0;  // when
  // Apart, so that frequent saving does not keep combiners from their share.
  double plainSpent_ = 0, combinedSpent_ = 0;
  Costs cost_;
  bool any_ = false, combinedOut_ = false, plainKnown_ = false, combinedKnown_ = false;
  uint64_t nextLook_ = kLeastSamples;
};

}  // namespace braid
