// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/publication_schedule.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace braid {

// With a limit all of it, otherwise what there was so far.
double PublicationSchedule::lengthOfRun(const Progress& p, double least) {
  return p.secondsLeft >= 0 ? p.seconds + p.secondsLeft : std::max(least, p.seconds);
}

PublicationSchedule::Due PublicationSchedule::due(const Progress& p) const {
  Due due;
  if (p.rounds > 0 && p.round >= p.rounds) return due;
  const bool soonOver = p.secondsLeft >= 0 && p.secondsLeft < kSoon;
  const auto since = [&](double last) { return saveEvery_ > 0 && p.seconds - last >= saveEvery_; };
  const bool mark = !soonOver && std::has_single_bit(p.round);
  const double plainRun = any_ ? p.seconds : lengthOfRun(p, kLeastRun);
  const bool plainPays = plainSpent_ + cost_.plain <= kPlainShare * plainRun;
  const bool combinedPays = combines_ && any_ && combinedSpent_ <= kShare * p.seconds &&
                            combinedSpent_ + withLast(cost_.combined) <= kShare * lengthOfRun(p, 0);
  due.state = (mark && plainPays) || since(lastState_);
  due.combined = (mark || since(lastImage_)) && combinedPays;
  due.image = due.combined || (!combinedOut_ && ((mark && plainPays) || since(lastImage_)));
  return due;
}

bool PublicationSchedule::looksAt(const Progress& p) const {
  const bool last = p.rounds > 0 && p.round >= p.rounds;
  return targetError_ > 0 && !last && p.round >= nextLook_ && std::has_single_bit(p.round);
}

void PublicationSchedule::begun(const Due& what, const Progress& p) {
  if (what.state) lastState_ = p.seconds;
  if (!what.image) return;
  lastImage_ = p.seconds;
  any_ = true;
}

void PublicationSchedule::published(uint64_t samples, bool combined, double cost, std::optional<double> error) {
  (combined ? combinedSpent_ : plainSpent_) += cost;
  (combined ? cost_.combined : cost_.plain) = cost;
  (combined ? combinedKnown_ : plainKnown_) = true;
  combinedOut_ = combinedOut_ || combined;
  if (targetError_ <= 0 || !combined || !error || !(*error > targetError_)) return;
  const double needed = std::min(1e15, static_cast<double>(samples) * std::sqrt(*error / targetError_));
  nextLook_ = std::max(kLeastSamples, static_cast<uint64_t>(std::ceil(needed)));
}

bool PublicationSchedule::tooLong(const Progress& p, double cost) const {
  return combinedSpent_ + withLast(cost) > kShare * lengthOfRun(p, kLeastRun);
}

// It would have taken longer: by how much nobody knows.
void PublicationSchedule::givenUp(double cost) {
  combinedSpent_ += cost;
  cost_.combined = 2 * cost;
  combinedKnown_ = true;
}

}  // namespace braid
