// SPDX-License-Identifier: Apache-2.0
// What will run and what is left out, with a reason for each: a pure function of the scene's traits and the settings.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/camera.h"
#include "renderer/scene/scene.h"
#include "renderer/session/settings.h"
#include "renderer/transport/lights/light_sampler.h"

namespace braid {

class Integrator;

struct PlanLine {
  bool kept = true;
  std::string subject;  // e.g. "pt", "alpha filter"
  std::string reason;
};

struct PlannedIntegrator {
  const Integrator* integrator = nullptr;
  int passesPerRound = 1;
};

struct Plan {
  Settings settings;
  Camera camera;
  PixelWindow window;
  KeptBuffers kept;                      // settings.keep where integrators provide it; more with settings.full
  std::optional<LightKinds> lightKinds;  // where there are several
  std::vector<PlannedIntegrator> integrators;
  std::vector<PlanLine> lines;
  // What of the light in view no integrator of the plan can find, and the mend; empty where they find it. The estimated
  // error of such a render is not known: it does not see what is missing.
  std::string unreachable;
  bool placesSamples = false;  // settings.placement where it can be followed
  size_t filmLine = 0;         // of lines: where those about the film begin
  uint64_t filmBytesPerPixel = 0;

  int buckets() const { return kept.quarters ? 4 : 2; }
  // "+ subject: reason" for what is kept, "- subject: reason" for what is left out, one line each.
  std::string text() const;
  uint64_t hash() const;
};

// The item of pixel (x, y) of the full frame, by which its random numbers are keyed.
inline uint64_t pixelItem(const Plan& plan, int x, int y) {
  return static_cast<uint64_t>(y) * static_cast<uint64_t>(plan.settings.width) + static_cast<uint64_t>(x);
}

// `available` are the registered integrators. Throws Error(Usage) naming an unknown integrator and the known ones.
Plan makePlan(const Scene& scene, const CameraData& camera, const Settings& settings,
              const std::vector<const Integrator*>& available);

// The part of makePlan() that names the integrators, their passes of a round and the reasons; a pilot may render a few
// passes for it (integrators/README.md, The choice of integrators). The plan has its settings, camera and window.
void planIntegrators(const Scene& scene, const CameraData& camera, const std::vector<const Integrator*>& available,
                     Plan& plan);

// Keeps these as well: the plan that makePlan() would give for such settings, without another look at the scene.
void keepAlso(const KeptBuffers& more, Plan& plan);

}  // namespace braid
