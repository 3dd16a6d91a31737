// SPDX-License-Identifier: Apache-2.0
// Which integrators share the passes of a render: the mixture whose combined image is expected to err least for what it
// costs, by what a pilot measured of each (integrators/README.md, The choice of integrators). Numbers alone: no scene,
// no plan.
#pragma once

#include <cstddef>
#include <vector>

namespace braid {

// Of a block of 4 x 4 pixels, relative to its brightness or the square of that, mean over its pixels and channels.
struct PilotBlock {
  float mean = 0;       // of the pilot's image
  float noise = 0;      // variance of one pass that filters can take away: without fireflies
  float fireflies = 0;  // what these add to it
  float bias = 0;       // squared, of the mean of the pilot's passes, of photon maps; negative by its noise
};

// What a pilot measured of one integrator.
struct PilotMeasure {
  bool unbiased = true;
  double cost = 0;    // of a pass, in rays a pixel
  double passes = 0;  // of the pilot
  double hidden = 0;  // squared relative error by light that so few passes need not meet, alone
  std::vector<PilotBlock> blocks;
};

// An unbiased integrator, alone or beside a photon map: places in a list of measures.
struct Mixture {
  static constexpr size_t kNone = ~size_t(0);
  size_t unbiased = 0, photons = kNone;
};

// Expected relative squared error of the combined image of a mixture, at `cost` rays a pixel, over the blocks of a
// `group` of `groups` left out (groups = 0: over all of them).
double expectedError(const Mixture& mixture, const std::vector<PilotMeasure>& measures, double cost, size_t group = 0,
                     size_t groups = 0);

// Another mixture must be so many times better than the one that traits and light reach name.
inline constexpr double kMixturePays = 1.05;

struct MixtureChoice {
  size_t best = 0;                  // of the mixtures
  std::vector<double> error;        // expected, of each
  std::vector<double> uncertainty;  // standard error of the logarithm of error / that of the present mixture
};

// The place of the mixture to take. Another than the present one has to promise less error by kMixturePays, and by more
// than the uncertainty of the promise. Of two that are equal within that, one without photons is taken: it is simpler,
// and more filters can work on it.
size_t bestOf(const std::vector<Mixture>& mixtures, size_t present, const std::vector<double>& error,
              const std::vector<double>& uncertainty);

// The mixture to render, with as many rays as `samples` rounds of mixtures[present] take. There is a
// mixture, and all measures have as many blocks.
MixtureChoice chooseMixture(const std::vector<Mixture>& mixtures, size_t present,
                            const std::vector<PilotMeasure>& measures, double samples);

}  // namespace braid
