// SPDX-License-Identifier: Apache-2.0
// `braid plan`: what would run, what is left out, and why.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrators/registry.h"
#include "renderer/core/hash.h"
#include "tools/cli.h"
#include "tools/combining.h"

namespace braid {

namespace {

struct PlanOptions {
  SceneChoice scene;
  SampleChoice samples;
  CombineChoice combine;
  bool json = false;
};

int runPlan(const PlanOptions& o) {
  Settings settings = makeSettings(o.scene, o.samples);
  SceneData data = loadScene(o.scene);
  const CameraData camera = chooseCamera(data, o.scene);
  const std::unique_ptr<Scene> scene = buildScene(std::move(data), o.scene);
  const auto integrators = makeIntegrators();
  const Recipe recipe = planCombining(*scene, camera, settings, pointersTo(integrators), o.combine);
  const Plan plan = makePlan(*scene, camera, settings, pointersTo(integrators));
  const size_t memory[] = {scene->accel().bytes(), scene->geometryBytes(), scene->textureBytes()};
  if (!o.json) {
    fmt::print("{}{}", plan.text(), recipeText(recipe));
    fmt::print("memory: {:.1f} MiB hierarchies, {:.1f} MiB geometry, {:.1f} MiB textures\n",
               static_cast<double>(memory[0]) / 1048576.0, static_cast<double>(memory[1]) / 1048576.0,
               static_cast<double>(memory[2]) / 1048576.0);
    return 0;
  }
  nlohmann::json lines = nlohmann::json::array();
  for (const PlanLine& line : plan.lines)
    lines.push_back({{"kept", line.kept}, {"subject", line.subject}, {"reason", line.reason}});
  nlohmann::json combiners = nlohmann::json::array();
  for (const Step& step : recipe.steps)
    combiners.push_back({{"kept", step.obstacle.empty()}, {"subject", step.name}, {"reason", step.obstacle}});
  const nlohmann::json record = {{"schema", 1},
                                 {"scene", o.scene.file},
                                 {"traits", scene->traits().names()},
                                 {"plan", lines},
                                 {"combiners", combiners},
                                 {"hash", hexString(plan.hash())},
                                 {"memoryBytes",
                                  {{"hierarchies", memory[0]},
                                   {"geometry", memory[1]},
                                   {"textures", memory[2]},
                                   {"filmPerPixel", plan.filmBytesPerPixel}}}};
  fmt::print("{}\n", record.dump(2));
  return 0;
}

}  // namespace

void addPlan(CLI::App& app, Action& action) {
  auto options = std::make_shared<PlanOptions>();
  CLI::App* command = app.add_subcommand("plan", "Print what a render would keep and leave out, and why");
  command->footer("Example:\n  braid plan scene.glb --integrator auto");
  addSceneOptions(*command, options->scene);
  addSampleOptions(*command, options->samples);
  command
      ->add_option("--combine", options->combine.combine,
                   "none, or denoisers and combiners separated by commas (--list)")
      ->capture_default_str();
  addCombineOptions(*command, options->combine);
  command->add_flag("--json", options->json, "As JSON");
  command->callback([options, &action] { action = [options] { return runPlan(*options); }; });
}

}  // namespace braid
