// SPDX-License-Identifier: Apache-2.0
// An integrator renders passes: one sample per pixel each, a pure function of (scene, plan, pass index, seed).
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/film.h"
#include "renderer/session/plan.h"
#include "renderer/transport/context.h"
#include "renderer/transport/light_reach.h"
#include "renderer/transport/roulette.h"

namespace braid {

// Whether a scene needs an integrator, and why.
struct Applies {
  bool yes = true;
  std::string reason;
  bool open = false;  // a pilot may find otherwise (renderer/session/integrator_choice.cpp)
};

// Counts of one pass, for reports. Sums over tiles; order does not matter.
struct PassStatistics {
  std::atomic<uint64_t> paths{0}, rays{0}, shadowRays{0};
  std::atomic<uint64_t> photons{0};        // that gathers found
  std::atomic<int64_t> rejectedPixel{-1};  // y · frame width + x of one rejected sample
};

// What an integrator works out once per render and all its passes read, for instance which lights reach what is seen.
struct Preparation {
  virtual ~Preparation() = default;
  // What was decided on the way, and why.
  virtual std::vector<PlanLine> decisions() const { return {}; }
};

// A pass that renders some tiles of the window only (SamplePlacement), and what that took.
struct TilePass {
  static constexpr uint64_t kNone = ~uint64_t(0);
  std::vector<uint64_t> pass;  // by tile: whose random numbers its pixels take, or kNone: it is left out
  std::vector<uint64_t> hits;  // by tile: surfaces that its paths met
};

// Memory of a pass besides the film, and what it is for.
struct WorkingMemory {
  uint64_t bytes = 0;  // at most
  std::string use;
};

struct PassRequest {
  const TransportContext& context;
  const Plan& plan;
  uint64_t pass = 0;
  const std::atomic<bool>* cancel = nullptr;  // checked per tile; a cancelled pass is discarded
  PassStatistics* statistics = nullptr;
  std::vector<std::vector<RecordedRay>>* record = nullptr;  // per tile, for benchmarks; usually null
  const Preparation* preparation = nullptr;                 // of prepare(); null: the pass prepares for itself
  TilePass* tiles = nullptr;                                // null: all pixels; of integrators that place samples
};

class Integrator {
 public:
  virtual ~Integrator() = default;
  virtual const char* name() const = 0;
  virtual const char* description() const = 0;
  virtual bool unbiased() const { return true; }
  virtual bool splats() const { return false; }
  // Whether noise can make pixels negative: where passes are reconstructed from differences.
  virtual bool mayBeNegative() const { return false; }
  // Whether the passes of a bucket share a low-discrepancy sequence, for Accumulator::variance().
  virtual bool lowDiscrepancy(const Settings& settings) const { return settings.sampler == SamplerKind::Sobol; }
  // Whether a pass can render some tiles only: its pixels depend on nothing but themselves.
  virtual bool placesSamples() const { return false; }
  // Whether all paths of a pass have one time while the shutter is open, because paths of different pixels meet.
  virtual bool passesAreInstants() const { return false; }
  // Whether pixels share their random numbers.
  virtual Correlation correlation() const { return Correlation::Independent; }
  // Whether it estimates the bias of its passes (PassTarget::bias).
  virtual bool estimatesBias() const { return false; }
  // Whether it tells direct light from the rest (PassTarget::direct). Such an integrator does not splat.
  virtual bool separatesDirectLight() const { return false; }
  // A pure function of the plan and the scene; null when passes need nothing.
  virtual std::shared_ptr<const Preparation> prepare(const TransportContext&, const Plan&) const { return nullptr; }
  // `reach` says how light gets to what the camera sees (measured only when integrators are chosen automatically).
  virtual Applies applies(const SceneTraits& traits, const LightReach& reach) const = 0;
  // Share of the light in view that it cannot find, however long it renders.
  virtual double misses(const LightReach&) const { return 0; }
  // What prepare() will decide, or why it need not.
  virtual std::vector<PlanLine> planLines(const Plan&) const { return {}; }
  // Of one pass with this plan's window and settings.
  virtual WorkingMemory workingMemory(const Plan&) const { return {}; }
  // Renders pass `request.pass` of the plan's window into the target. Returns false when cancelled.
  virtual bool renderPass(const PassRequest& request, PassTarget& target) const = 0;

  // For replaying camera paths: the random numbers of a pass and of a pixel in it; none where there are no camera paths
  // by the path kernel.
  virtual std::unique_ptr<PassSampler> pixelSampler(const Plan&, uint64_t /*pass*/) const { return nullptr; }
  virtual uint64_t pixelKey(const PassSampler& sampler, const Plan& plan, int x, int y) const {
    return sampler.itemKey(pixelItem(plan, x, y));
  }
  // Of the path kernel.
  virtual Roulette roulette() const { return {}; }
};

}  // namespace braid
