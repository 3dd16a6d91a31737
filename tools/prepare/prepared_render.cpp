// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/prepared_render.h"

#include "braid/place_samples.h"
#include "integrators/registry.h"
#include "tools/images/exr_metadata.h"
#include "tools/prepare/scene_identity.h"
#include "version.h"

namespace braid {

PreparedRender prepareRender(const SceneChoice& scene, const Settings& settings, CombineChoice& combine,
                             const RenderExtent& extent) {
  return prepareRender(openScene(scene), settings, combine, extent);
}

PreparedRender prepareRender(OpenedScene opened, const Settings& settings, CombineChoice& combine,
                             const RenderExtent& extent) {
  PreparedRender r{std::move(opened), makeIntegrators(), {}};
  r.planned = planRender(r.scene(), r.opened.camera, settings, pointersTo(r.integrators), combine, extent);
  return r;
}

std::unique_ptr<Session> beginSession(const PreparedRender& render, const SceneChoice& choice) {
  requireWithinLimit(render.planned.memory);
  const Scene& scene = render.scene();
  auto session = std::make_unique<Session>(scene, render.planned.plan);
  if (session->plan().placesSamples) session->placeBy(errorsForPlacement(session->plan().settings.placement));
  session->identify(BRAID_VERSION, BRAID_BUILD_FLAGS, sceneIdentity(choice, scene.data()),
                    planAttributes(scene, session->plan(), scene.accel().isa()));
  return session;
}

}  // namespace braid
