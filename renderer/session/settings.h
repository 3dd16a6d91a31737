// SPDX-License-Identifier: Apache-2.0
// What a user asks of a render.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "renderer/core/sampler.h"
#include "renderer/film/film.h"
#include "renderer/film/kept_buffers.h"
#include "renderer/transport/lights/light_sampler.h"

namespace braid {

enum class PixelFilter { Box, Gaussian, BlackmanHarris };
// Whether camera paths learn where light comes from; automatic: where that pays.
enum class Guiding { Automatic, On, Off };

inline constexpr int kMostLightSamples = 64;
inline constexpr int kMostPathSplits = 8;

struct Settings {
  int width = 1280, height = 720;  // full frame, pixels
  std::optional<PixelWindow> crop;
  std::vector<std::string> integrators{"pt"};
  uint64_t spp = 64;        // passes of each integrator, those of a resumed state included; 0: no limit
  bool goesOn = false;      // more samples will come: of other machines, or of a run that goes on from this one's state
  uint64_t firstRound = 0;  // where the rounds begin: more than 0 for the later shares of a render on several machines
  double seconds = 0;       // wall-clock limit of the pass loop; 0: none
  int maxDepth = 32;        // segments of a path, the one from the camera included
  uint64_t seed = 0;
  SamplerKind sampler = SamplerKind::Sobol;
  PixelFilter filter = PixelFilter::Box;
  LightStrategy lightStrategy = LightStrategy::Automatic;
  Guiding guiding = Guiding::Automatic;
  int lightSamples = 0;  // of a camera path of pt at its first surface that is no mirror; 0: as many as pay
  int pathSplits = 1;    // directions that such a path goes on in from there; 0: as many as pay
  KeptBuffers keep{.features = true};
  bool transparent = false;            // camera rays that miss: no radiance, alpha 0
  std::optional<Spectrum> background;  // what camera rays that miss see instead of the environment
  float clamp = 0;                     // largest channel of one path's radiance; 0: off (unbiased)
  uint64_t photons = 0;                // light paths of a photon mapping pass; 0: one per pixel of the window
  float photonRadius = 5;              // of the first passes, in pixels as seen from the camera
  bool photonDirect = false;           // direct light by photons too, not by next-event estimation
  bool photonAiming = true;            // choose lights also by whether their photons arrive where the camera looks
  // Whose estimated error says where samples go (renderer/README.md, Placement of samples): a method's, or "none" for
  // that of the samples alone; empty: all pixels get as many.
  std::string placement;
  bool full = false;  // leave nothing out
  int threads = 0;    // 0: all that the process may use
};

}  // namespace braid
