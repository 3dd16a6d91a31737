// SPDX-License-Identifier: Apache-2.0
// The options that choose a scene, a view and samples, which many subcommands share.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/data/gltf.h"
#include "renderer/session/settings.h"
#include "tools/options/syntax/option_texts.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace braid {

struct SceneChoice {
  std::string file;
  LoadOptions load;
  FrameSize size{1280, 720};
  std::optional<PixelWindow> crop;
  std::string camera;  // name or index
  std::optional<LookAt> lookAt;
  double yfovDegrees = 0;
  std::string environment;
  double environmentRotation = 0;  // degrees
  double environmentScale = 1;
  double lightScale = 1;
  std::optional<Spectrum> background;
  DefaultLight defaultLight = DefaultLight::Studio;
  bool ground = false;
  std::optional<Aperture> aperture;
  std::optional<Focus> focus;
  std::string isa = "avx2";
  bool full = false;
  int frameScene = -1;
  double frameTime = -1;
  bool turntable = false;  // the camera goes about the scene
  bool quiet = false, verbose = false;
};
void addSceneOptions(CLI::App& command, SceneChoice& choice);
// Those of them that any number of scenes can have in common: camera, pose, light, reading.
void addSceneViewOptions(CLI::App& command, SceneChoice& choice);

struct SampleChoice {
  std::vector<std::string> integrators{"pt"};
  SamplerKind sampler = SamplerKind::Sobol;
  PixelFilter filter = PixelFilter::Box;
  LightStrategy lights = LightStrategy::Automatic;
  Guiding guiding = Guiding::Automatic;
  int lightSamples = 0;  // 0: as many as pay
  int pathSplits = 1;    // 0: as many as pay
  double seconds = 0;    // of --time, 0: none
  uint64_t spp = 0;      // 0: not said
  int maxDepth = 32;
  uint64_t seed = 0;
  int threads = 0;
  double clamp = 0;
  bool placeSamples = false;  // of commands with addPlacement()
  uint64_t photons = 0;
  double photonRadius = 5;
  bool photonDirect = false, noPhotonAiming = false;
};
void addSampleOptions(CLI::App& command, SampleChoice& choice);

// --place-samples, of commands that can.
void addPlacement(CLI::App& command, SampleChoice& choice);

// --size and --sampler, of commands that take no others of these groups.
CLI::Option* addSize(CLI::App& command, FrameSize& size, const char* description = "Frame in pixels");
CLI::Option* addSampler(CLI::App& command, SamplerKind& sampler);
CLI::Option* addIsa(CLI::App& command, std::string& isa);
const char* toString(SamplerKind sampler);
const char* toString(DefaultLight light);

// Settings from the two groups of options.
Settings makeSettings(const SceneChoice& scene, const SampleChoice& samples);

}  // namespace braid
