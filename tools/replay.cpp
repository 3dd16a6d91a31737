// SPDX-License-Identifier: Apache-2.0
// `braid replay`: follows one camera path and prints what happens at every vertex. A pass is a pure function of the
// scene, the seed and its index, so any sample of any render can be looked at again.
#include <fmt/format.h>

#include "integrators/path_kernel.h"
#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "tools/cli.h"

namespace braid {

namespace {

struct ReplayOptions {
  SceneChoice scene;
  SampleChoice samples;
  uint64_t pass = 0;
  std::string pixel;
};

std::string show(const Vec3& v) { return fmt::format("({:.6g} {:.6g} {:.6g})", v.x, v.y, v.z); }

class PrintingObserver final : public PathObserver {
 public:
  explicit PrintingObserver(const Scene& scene) : scene_(scene) {}
  void onRay(const PathState& path) override {
    fmt::print("{}: ray from {} along {}, throughput {}\n", path.segments, show(path.origin), show(path.direction),
               show(path.throughput));
  }
  void onMiss() override { fmt::print("   leaves the scene\n"); }
  void onHit(const Hit& hit) override {
    fmt::print("   hits mesh {} '{}', triangle {}, material '{}' at {}, {:.6g} m away, {} side, shading normal {}\n",
               hit.meshIndex, hit.mesh->name, hit.triangle, hit.material->name, show(hit.position), hit.distance,
               hit.front ? "front" : "back", show(hit.frame.n));
  }
  void onLight(const ShadowRay& ray, bool visible) override {
    fmt::print("   light sample along {}: {} {}\n", show(ray.ray.direction), visible ? "adds" : "hidden, would add",
               show(ray.contribution));
  }

 private:
  const Scene& scene_;
};

int runReplay(const ReplayOptions& o) {
  const Settings settings = makeSettings(o.scene, o.samples);
  int x = 0, y = 0;
  char rest = 0;
  if (std::sscanf(o.pixel.c_str(), "%d,%d%c", &x, &y, &rest) != 2 || x < 0 || y < 0 || x >= settings.width ||
      y >= settings.height)
    throw Error(ExitCode::Usage, fmt::format("--pixel '{}': expected X,Y inside the {}x{} frame", o.pixel,
                                             settings.width, settings.height));
  SceneData data = loadScene(o.scene);
  const CameraData camera = chooseCamera(data, o.scene);
  const std::unique_ptr<Scene> scene = buildScene(std::move(data), o.scene);
  const auto integrators = makeIntegrators();
  const Plan plan = makePlan(*scene, camera, settings, pointersTo(integrators));
  const TransportContext context(*scene, settings.lightStrategy);
  const Integrator& integrator = *plan.integrators.front().integrator;
  const auto sampler = integrator.pixelSampler(plan, o.pass);
  if (!sampler)
    throw Error(ExitCode::Usage, fmt::format("integrator '{}' has no camera paths to replay", integrator.name()));

  PrintingObserver observer(*scene);
  PathKernel kernel(context, plan, *sampler, nullptr);
  kernel.observe(&observer);
  fmt::print("{} pass {} pixel {},{} of {}x{}\n", integrator.name(), o.pass, x, y, settings.width, settings.height);
  kernel.start(x, y, integrator.pixelKey(*sampler, plan, x, y));
  kernel.run();
  fmt::print("radiance {}\n", show(kernel.sample(0).radiance));
  return 0;
}

}  // namespace

void addReplay(CLI::App& app, Action& action) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* command = app.add_subcommand("replay", "Follow one path of a render, vertex by vertex");
  command->footer("Example:\n  braid replay scene.glb --pass 17 --pixel 200,131");
  addSceneOptions(*command, options->scene);
  addSampleOptions(*command, options->samples);
  command->add_option("--pass", options->pass, "Index of the pass")->capture_default_str();
  command->add_option("--pixel", options->pixel, "X,Y in the full frame")->required();
  command->callback([options, &action] { action = [options] { return runReplay(*options); }; });
}

}  // namespace braid
