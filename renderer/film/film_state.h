// SPDX-License-Identifier: Apache-2.0
// Everything that a render has gathered: the sums of all passes so far and which passes they are. A render goes on from
// it, several machines' states add up to one, and estimates are views of it. Sums are kept in double, so that adding
// those of disjoint passes gives what one run would have given: exactly for sums of floats, to rounding for squares.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/direct_light.h"
#include "renderer/film/sample_placement.h"

namespace braid {

// Passes [begin, end) of one integrator.
struct PassInterval {
  uint64_t begin = 0, end = 0;
  uint64_t count() const { return end - begin; }
  bool operator==(const PassInterval&) const = default;
};

// Limits of what a state may claim, far beyond any render.
inline constexpr uint64_t kMaxPass = uint64_t(1) << 48;

struct EstimateState {
  std::string name;
  bool unbiased = true;
  Correlation correlation = Correlation::Independent;
  bool lowDiscrepancy = false;  // for Accumulator::variance()
  int passesPerRound = 1;
  std::vector<PassInterval> passes;  // disjoint, ascending, not touching
  double seconds = 0;
  Accumulator sums{0, 0, 2};
  std::optional<DirectLightAccumulator> parts;  // where direct light is kept by itself
  std::vector<Checkpoint> history;

  uint64_t firstPass() const { return passes.empty() ? 0 : passes.front().begin; }
  uint64_t endPass() const { return passes.empty() ? 0 : passes.back().end; }
  // What state files hold of it besides the history.
  RawSums rawSums();
  // Notes that `pass`, not before endPass(), is among the sums.
  void addPass(uint64_t pass);
  // Adds the present variance to the history; and the image, if it is the first in the history of at least one of
  // these numbers of passes, and one that combiners improve: unbiased, with independent pixels.
  // `placement`: that of the film, or null.
  void keepCheckpoint(const std::vector<uint64_t>& stops, const SamplePlacement* placement = nullptr);
};

// An option that changes pixels, under its name on the command line.
struct StateOption {
  std::string name, value;
  bool operator==(const StateOption&) const = default;
};

// What states must share for their passes to be samples of one image.
struct StateIdentity {
  std::string version;     // of braid
  std::string build, isa;  // other bits, the same expectation
  uint64_t sceneHash = 0;  // over every byte of the scene's files
  std::vector<StateOption> options;
};

// Numbers of passes after which denoising stops, as an option: histories hold the image there. Rising order, not 0.
// None is no option.
std::vector<StateOption> stopOptions(const std::vector<uint64_t>& stops);
std::vector<uint64_t> stopsOf(const StateIdentity& identity);

struct FilmState {
  StateIdentity identity;
  uint64_t seed = 0;
  PixelWindow window;
  int fullWidth = 0, fullHeight = 0;
  int buckets = 2;
  double seconds = 0;  // of the pass loops, summed over machines
  std::vector<EstimateState> estimates;
  std::optional<FeatureAccumulator> features;
  std::optional<CoverageAccumulator> coverage;  // with a transparent background
  std::optional<SamplePlacement> placement;     // where the only estimate has samples that differ between tiles
  std::vector<Attribute> attributes;            // of image headers, as far as they do not depend on the passes

  // What does not depend on the integrator: features, coverage and numbers of samples.
  RawSums sharedSums();
  // Rounds whose passes are all done.
  uint64_t rounds() const;
  uint64_t rejected() const;
};

// What combiners and writers see. `quarters`: also the four buckets, if there are that many.
Estimates estimatesOf(const FilmState& state, bool quarters);

// The one estimate of a film with placement as one half of its samples shows it, and nothing of the other: mean and
// variance of the half, its two buckets as halves, the features that it saw. `features`: those too.
Estimates estimatesOfHalf(const FilmState& state, int half, bool features);

// What keeps `there` from being continued or joined by `here`: "--max-depth was 8 and is 32; ..."; empty: nothing.
// `sameBits`: a difference of build or instruction set counts too.
std::string difference(const StateIdentity& there, const StateIdentity& here, bool sameBits);

// The first pass interval that both hold, as a sentence, or empty.
std::string overlap(const FilmState& a, const FilmState& b);

// Whether both hold sums of the same estimates, of the same names and of one window.
bool holdSameSums(const FilmState& a, const FilmState& b);

// Adds the passes of a later share to those of an earlier one: identities equal (difference() empty), passes disjoint
// (overlap() empty), the same sums, and `next` begins behind `state`. Histories do not add up: that of `state` stays,
// and grows by the point before this addition, if there is a history at all; where denoising is to stop, the image is
// that of the first shares that have passes enough.
void addShare(FilmState& state, const FilmState& next);

}  // namespace braid
