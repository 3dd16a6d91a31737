// SPDX-License-Identifier: Apache-2.0
// What the subcommands share: options that choose a scene, a view and samples, and loading with its warnings.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/data/gltf.h"
#include "renderer/scene/scene.h"
#include "renderer/session/settings.h"
#include "tools/options/option_texts.h"

namespace CLI {
class App;
}

namespace braid {

// A subcommand sets this to what main() should run; it returns the exit code.
using Action = std::function<int()>;

void addRender(CLI::App& app, Action& action);
void addPreview(CLI::App& app, Action& action);
void addPlan(CLI::App& app, Action& action);
void addInfo(CLI::App& app, Action& action);
void addBench(CLI::App& app, Action& action);
void addReplay(CLI::App& app, Action& action);
void addCompare(CLI::App& app, std::function<int()>& action);
void addCombine(CLI::App& app, Action& action);
void addMerge(CLI::App& app, Action& action);
void addSweep(CLI::App& app, Action& action);

// The options of braid itself, and all subcommands.
struct MainOptions {
  bool list = false;
  std::string memoryLimit;
};
void addCommands(CLI::App& app, MainOptions& options, Action& action);

// Options of every subcommand that reads a scene and looks at it.
struct SceneChoice {
  std::string file;
  LoadOptions load;
  std::string size = "1280x720";
  std::string crop;
  std::string camera;  // name or index
  std::string lookAt;  // ox,oy,oz,tx,ty,tz
  double yfovDegrees = 0;
  std::string environment;
  double environmentRotation = 0;  // degrees
  double environmentScale = 1;
  double lightScale = 1;
  std::string background;
  bool noDefaultLight = false;
  std::string isa = "avx2";
  bool full = false;
  int frameScene = -1;
  double frameTime = -1;
  bool quiet = false, verbose = false;
};

struct LoadTimes {
  double load = 0;  // seconds: reading and decoding
};

void addSceneOptions(CLI::App& command, SceneChoice& choice);
// Options that shape the samples: integrator, sampler, depth, seed, filter, threads.
struct SampleChoice {
  std::string integrators = "pt";
  std::string sampler = "sobol";
  std::string filter = "box";
  std::string lights = "auto";
  std::string time;
  uint64_t spp = 0;
  int maxDepth = 32;
  uint64_t seed = 0;
  int threads = 0;
  double clamp = 0;
  uint64_t photons = 0;
  double photonRadius = 5;
  bool photonDirect = false, noPhotonAiming = false;
};
void addSampleOptions(CLI::App& command, SampleChoice& choice);

// Loads the file with everything the choice changes in it (environment, light scale); warnings go to standard error
// unless quiet.
SceneData loadScene(const SceneChoice& choice, LoadTimes* times = nullptr);
// Builds what rays need, and adds the default light where the camera would see next to nothing; the warning goes to
// standard error unless quiet.
std::unique_ptr<Scene> buildScene(SceneData data, const SceneChoice& choice, const CameraData& camera);
// The camera that the choice names. Throws Error(Usage) listing the cameras when there is none of that name.
CameraData chooseCamera(const SceneData& data, const SceneChoice& choice);
// Settings from the two groups of options.
Settings makeSettings(const SceneChoice& scene, const SampleChoice& samples);

}  // namespace braid
