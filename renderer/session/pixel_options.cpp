// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/pixel_options.h"

#include <fmt/format.h>

#include "renderer/core/hash.h"
#include "renderer/session/integrator.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/session/placement_map.h"
#include "renderer/session/rendering_revision.h"

namespace braid {

namespace {

const char* yesOrNo(bool yes) { return yes ? "on" : "off"; }

std::string cameraHash(const Camera& camera) {
  ContentHash hash;
  const auto add = [&](const Camera& c) {
    for (const Mat4& m : {c.worldToCamera(), c.worldToNdc()})
      for (int i = 0; i < 4; ++i) hash.add(&m[i], sizeof m[i]);
  };
  add(camera);
  if (camera.moves())
    for (const float time : {0.25f, 0.5f, 0.75f, 1.0f}) add(camera.at(time));
  return hexString(hash.value());
}

const char* toString(LightStrategy strategy) {
  return strategy == LightStrategy::Automatic ? "auto" : strategy == LightStrategy::Power ? "power" : "hierarchy";
}

const char* toString(Guiding guiding) {
  return guiding == Guiding::Automatic ? "auto" : guiding == Guiding::On ? "on" : "off";
}

}  // namespace

std::vector<StateOption> pixelOptions(const Plan& plan) {
  const Settings& s = plan.settings;
  const PixelWindow& w = plan.window;
  std::string integrators;
  for (const PlannedIntegrator& p : plan.integrators)
    integrators += fmt::format("{}{}{}", integrators.empty() ? "" : ",", p.integrator->name(),
                               p.passesPerRound > 1 ? fmt::format("*{}", p.passesPerRound) : "");
  std::vector<StateOption> list{
      {"the rendering revision", std::to_string(kRenderingRevision)},
      {"--size", fmt::format("{}x{}", s.width, s.height)},
      {"--crop", fmt::format("{},{},{},{}", w.x0, w.y0, w.x1, w.y1)},
      {"the camera", cameraHash(plan.camera)},
      {"--integrator", integrators},
      {"--seed", std::to_string(s.seed)},
      {"--sampler", s.sampler == SamplerKind::Sobol ? "sobol" : "independent"},
      {"--filter", toString(s.filter)},
      {"--max-depth", std::to_string(s.maxDepth)},
      {"--lights", toString(s.lightStrategy)},
      {"--guiding", toString(s.guiding)},
      {"--light-samples", s.lightSamples > 0 ? std::to_string(s.lightSamples) : "auto"},
      {"--path-splits", s.pathSplits > 0 ? std::to_string(s.pathSplits) : "auto"},
      {"--clamp", fmt::format("{}", s.clamp)},
      {"--background",
       s.background ? fmt::format("{},{},{}", s.background->x, s.background->y, s.background->z) : "none"},
      {"--transparent", yesOrNo(s.transparent)},
      {"--photons", std::to_string(s.photons)},
      {"--photon-radius", fmt::format("{}", s.photonRadius)},
      {"--photon-direct", yesOrNo(s.photonDirect)},
      {"photon aiming", yesOrNo(s.photonAiming)},
      {"keeping quarters", yesOrNo(plan.kept.quarters)},
      {"keeping features", yesOrNo(plan.kept.features)},
      {"keeping history", yesOrNo(s.keep.history)},
      {"keeping direct light", yesOrNo(plan.kept.directIndirect)}};
  if (plan.placesSamples) list.push_back({kPlacementOption, s.placement});
  for (StateOption& stop : stopOptions(s.keep.stops)) list.push_back(std::move(stop));
  return list;
}

}  // namespace braid
