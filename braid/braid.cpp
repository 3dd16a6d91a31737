// SPDX-License-Identifier: Apache-2.0
#include "braid/braid.h"

#include "integrators/registry.h"
#include "renderer/session/default_light.h"

namespace braid {

std::unique_ptr<Scene> load(const std::string& path, const LoadOptions& options, const SceneOptions& sceneOptions,
                            const LogSink& log) {
  auto scene = std::make_unique<Scene>(loadGltf(path, options, log), sceneOptions);
  if (options.defaultLight == DefaultLight::None) return scene;
  const Settings usual;
  const std::optional<std::string> warning =
      lightIfDark(*scene, scene->data().cameras.front(), usual.width, usual.height, 1, options.defaultLight);
  if (warning && log) log(LogLevel::Warning, path + ": " + *warning);
  return scene;
}

RenderPlan plan(const Scene& scene, const Settings& settings, const CameraData& camera) {
  const auto integrators = std::make_shared<const std::vector<std::unique_ptr<Integrator>>>(makeIntegrators());
  return {integrators, makePlan(scene, camera, settings, pointersTo(*integrators))};
}

RenderPlan plan(const Scene& scene, const Settings& settings) {
  if (scene.data().cameras.empty()) throw Error(ExitCode::Usage, "the scene has no camera: give one to plan()");
  return plan(scene, settings, scene.data().cameras.front());
}

Rendering render(const Scene& scene, const RenderPlan& plan, const Session::ProgressCallback& progress) {
  Rendering r{Session(scene, plan.plan).run(progress), {}};
  ExrOptions options;
  options.quarters = plan.plan.settings.keep.quarters;
  for (const ExrChannel& p : namedPlanes(*r.estimates, r.image, r.alpha ? &*r.alpha : nullptr, options))
    r.planes.emplace(p.name, *p.plane);
  return r;
}

}  // namespace braid
