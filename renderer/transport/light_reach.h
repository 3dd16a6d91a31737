// SPDX-License-Identifier: Apache-2.0
// How the light of a scene reaches what the camera sees, measured with a few thousand light subpaths: the plan decides
// from it whether light subpaths are worth their time.
#pragma once

#include "renderer/scene/camera.h"
#include "renderer/transport/context.h"

namespace braid {

// Shares of the light that finite and directional lights send to rough surfaces which the camera sees, directly or over
// mirrors and through glass.
struct LightReach {
  double direct = 0;    // arriving straight from a light
  double indirect = 0;  // after scattering, the last time from a rough surface
  double caustic = 0;   // the last time from a mirror, a lens or another surface that focuses
  // Of the caustics what smooth surfaces focus, over which no light sample can be aimed: camera paths have to hit the
  // light by chance.
  double causticBySmooth = 0;
  // Of the caustics what the camera sees over mirrors and through glass alone: connections find it by rare chance.
  double causticOverMirrors = 0;
  // Relative variance that caustics give to one camera path: Σ share / probability of finding it, by hitting the light
  // over the focusing surface or, where that is rough, by sampling the light there. 1 is as bad as a signal that one
  // path in two sees.
  double causticVariance = 0;
  // Not a share: the radiance that all light but the direct gives to a white surface, averaged over what the camera
  // sees, W/(m² sr).
  double scatteredRadiance = 0;
  // From points and directions, scattered first by a mirror, a smooth refraction or a medium: light sampling cannot aim
  // over these, and nothing hits such lights, so that no camera path finds it at all.
  double beyondCameraPaths = 0;
  // Of that what a medium has scattered: light samples cannot be connected to its events.
  double throughMedia = 0;
  // Of the light beyond camera paths, what arrives over mirrors and through glass alone where the camera sees it in the
  // same way: nothing can be connected, only photons find it.
  double beyondConnections = 0;
};

// A pure function of the scene and the camera. Costs about as much as a pass of 128 x 128 pixels.
LightReach measureLightReach(const TransportContext& context, const Camera& camera, int width, int height);

}  // namespace braid
