// SPDX-License-Identifier: Apache-2.0
#include "tools/options/cli.h"

#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "renderer/session/default_light.h"
#include "tools/options/memory_limit.h"
#include "tools/options/option_checks.h"

namespace braid {

namespace {

std::vector<double> parseLookAt(const std::string& text) { return parseNumbers(text, 6, -1e15, 1e15); }
std::vector<double> parseBackground(const std::string& text) { return parseNumbers(text, 3, 0, kLargeNumber); }

template <class T>
T choose(const std::string& name, const char* option, const std::vector<std::pair<std::string, T>>& table) {
  std::string known;
  for (const auto& [key, value] : table) {
    if (key == name) return value;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", key);
  }
  throw Error(ExitCode::Usage, fmt::format("unknown {} '{}': known are {}", option, name, known));
}

}  // namespace

void addCommands(CLI::App& app, MainOptions& o, Action& action) {
  app.require_subcommand(0, 1);
  app.add_flag("--list", o.list, "Print every registered integrator, denoiser, combiner and metric");
  app.add_option("--memory-limit", o.memoryLimit, "Memory that may be taken, such as 4G; beyond it: exit code 5")
      ->check(readBy(parseBytes))
      ->type_name("SIZE");
  app.fallthrough();
  addRender(app, action);
  addPreview(app, action);
  addPlan(app, action);
  addInfo(app, action);
  addCompare(app, action);
  addCombine(app, action);
  addMerge(app, action);
  addSweep(app, action);
  addReplay(app, action);
  addBench(app, action);
}

void addSceneOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("SCENE", c.file, "glTF 2.0 file, .gltf or .glb")->required()->type_name("FILE");
  command.add_option("--size", c.size, "Full frame in pixels")
      ->capture_default_str()
      ->check(readBy(parseSize))
      ->type_name("WIDTHxHEIGHT");
  command
      .add_option("--crop", c.crop,
                  "Render only this part of the full frame (pixels, upper left origin, ends excluded)")
      ->check(readBy(parseWindow))
      ->type_name("x0,y0,x1,y1");
  command.add_option("--camera", c.camera, "Camera by name or index (default: the first)")->type_name("NAME");
  command.add_option("--look-at", c.lookAt, "Eye and target instead of the file's camera, in metres")
      ->check(readBy([](const std::string& text) { parseLookAt(text); }))
      ->type_name("ox,oy,oz,tx,ty,tz");
  command.add_option("--yfov", c.yfovDegrees, "Vertical field of view in degrees")
      ->check(number(0, 180, Ends::Excluded));
  command.add_option("--scene", c.frameScene, "Index of the glTF scene to render")->check(wholeNumber(0, 1000000));
  command.add_option("--variant", c.load.variant, "Material variant by name (KHR_materials_variants)")
      ->type_name("NAME");
  command
      .add_option("--frame-time", c.frameTime,
                  "Pose of skins, morphs and nodes at this time of an animation, in seconds")
      ->check(number(0, 1e9));
  command.add_option("--animation", c.load.animation, "Animation by name or index (default: the first)")
      ->type_name("NAME");
  command.add_option("--env", c.environment, "Environment image, latitude-longitude (.hdr, .exr, ...)")
      ->type_name("FILE");
  command
      .add_option("--env-rotate", c.environmentRotation,
                  "Turn the environment about +Y, degrees; at 0 its centre lies in +X, as in three.js and Blender")
      ->check(number(-36000, 36000));
  command.add_option("--env-scale", c.environmentScale, "Multiply the environment")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  command
      .add_option("--background", c.background, "Radiance seen by camera rays that miss, instead of the environment")
      ->check(readBy([](const std::string& text) { parseBackground(text); }))
      ->type_name("r,g,b");
  command.add_option("--light-scale", c.lightScale, "Multiply every light and emitter of the file")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  command.add_flag("--no-default-light", c.noDefaultLight,
                   "No grey dome where the file's lights leave the picture dark");
  command.add_flag("--allow-external", c.load.allowExternal,
                   "Read files outside of the scene's folder too: ../, absolute paths, symbolic links");
  command.add_flag("--strict", c.load.strict, "Refuse a file with any problem, listing all of them (exit code 2)");
  command
      .add_option("--ignore-extension", c.load.ignoredExtensions,
                  "Render although the file requires this unknown extension (repeatable)")
      ->allow_extra_args(false)
      ->type_name("NAME");
  command.add_flag("--double-sided", c.load.doubleSided, "Treat every material as double-sided");
  command.add_flag("--full", c.full, "Leave nothing out that the scene does not need (same pixels, for checking)");
  command.add_option("--isa", c.isa, "Instruction set for Embree: avx2, avx512, sse4.2, or 'auto'")
      ->capture_default_str()
      ->type_name("NAME");
  command.add_flag("-q,--quiet", c.quiet, "Errors only");
  command.add_flag("-v,--verbose", c.verbose, "Also print the plan");
}

void addSampleOptions(CLI::App& command, SampleChoice& c) {
  command.add_option("--integrator", c.integrators, "Integrators, separated by commas, or auto")
      ->capture_default_str()
      ->type_name("NAMES");
  command.add_option("--spp", c.spp, "Samples per pixel of each integrator (default 64 unless --time is given)")
      ->check(wholeNumber(1, kMostSamples));
  command.add_option("--time", c.time, "Stop after this wall-clock time: 90, 90s, 2m, 1h")
      ->check(duration())
      ->type_name("DURATION");
  command.add_option("--max-depth", c.maxDepth, "Longest path in segments, the camera's included")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000000));
  command.add_option("--seed", c.seed, "Seed of the random numbers")->capture_default_str()->check(anySeed());
  command.add_option("--sampler", c.sampler, "sobol or independent")->capture_default_str()->type_name("NAME");
  command.add_option("--filter", c.filter, "Pixel filter: box, gaussian or blackman-harris")
      ->capture_default_str()
      ->type_name("NAME");
  command.add_option("--lights", c.lights, "How lights are chosen: auto, power or hierarchy")
      ->capture_default_str()
      ->type_name("NAME");
  addThreads(command, c.threads);
  command.add_option("--clamp", c.clamp, "Clamp a path's radiance (biased; 0: off)")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  command.add_option("--photons", c.photons, "Light paths of a photon mapping pass (default: one per pixel)")
      ->check(wholeNumber(1, uint64_t(1) << 28));
  command.add_option("--photon-radius", c.photonRadius, "First gather radius of photon mapping, in pixels")
      ->capture_default_str()
      ->check(number(0.01, 1000));
  command.add_flag("--photon-direct", c.photonDirect, "Photon mapping for direct light too");
  command.add_flag("--no-photon-aiming", c.noPhotonAiming,
                   "Choose photons' lights by power alone, not also by what arrives where the camera looks");
}

SceneData loadScene(const SceneChoice& c, LoadTimes* times) {
  const Stopwatch clock;
  LoadOptions options = c.load;
  options.defaultLight = !c.noDefaultLight && c.environment.empty();
  options.keepAllAttributes = c.full;
  options.camera = c.lookAt.empty() ? c.camera : "none";
  if (c.frameScene >= 0) options.scene = c.frameScene;
  if (c.frameTime >= 0) options.frameTime = static_cast<float>(c.frameTime);
  const LogSink sink = [&c](LogLevel level, const std::string& line) {
    if (!c.quiet && level == LogLevel::Warning) fmt::print(stderr, "warning: {}\n", line);
  };
  SceneData data = loadGltf(c.file, options, sink);
  const auto scale = static_cast<float>(c.lightScale);
  if (!c.environment.empty()) {
    EnvironmentData e;
    e.image = readImageFile(c.environment);
    e.radiance = Spectrum(static_cast<float>(c.environmentScale));
    e.rotation = glm::radians(static_cast<float>(c.environmentRotation));
    data.environment = e;
  } else if (data.environment) {
    data.environment->radiance *= scale;
  }
  for (Material& m : data.materials) m.emission *= scale;
  for (PunctualLight& l : data.lights) l.intensity *= scale;
  if (times) times->load = clock.seconds();
  return data;
}

std::unique_ptr<Scene> buildScene(SceneData data, const SceneChoice& c, const CameraData& camera) {
  SceneOptions options;
  options.isa = c.isa == "auto" ? "" : c.isa;
  options.full = c.full;
  auto scene = std::make_unique<Scene>(std::move(data), options);
  if (c.noDefaultLight || !c.environment.empty()) return scene;
  const auto [width, height] = parseSize(c.size);
  const std::optional<std::string> warning =
      lightIfDark(*scene, camera, width, height, static_cast<float>(c.lightScale));
  if (warning && !c.quiet) fmt::print(stderr, "warning: {}: {}\n", c.file, *warning);
  return scene;
}

CameraData chooseCamera(const SceneData& data, const SceneChoice& c) {
  CameraData camera;
  if (!data.cameras.empty()) camera = data.cameras[0];
  if (!c.camera.empty()) {
    std::string known;
    bool found = false;
    for (size_t i = 0; i < data.cameras.size() && !found; ++i) {
      const std::string& name = data.cameras[i].name;
      known += fmt::format("{}{} '{}'", known.empty() ? "" : ", ", i, name);
      if (name != c.camera && std::to_string(i) != c.camera) continue;
      camera = data.cameras[i];
      found = true;
    }
    if (!found)
      throw Error(ExitCode::Usage,
                  fmt::format("no camera '{}' in {}: it has {}", c.camera, c.file, known.empty() ? "none" : known));
  }
  if (!c.lookAt.empty()) {
    const std::vector<double> n = parseLookAt(c.lookAt);
    const glm::dvec3 o = data.origin;
    const Vec3 eye(n[0] - o.x, n[1] - o.y, n[2] - o.z), target(n[3] - o.x, n[4] - o.y, n[5] - o.z);
    if (eye == target) throw Error(ExitCode::Usage, "--look-at: eye and target are the same point");
    const Vec3 forward = glm::normalize(target - eye);
    const Vec3 up = std::abs(forward.y) > 0.999f ? Vec3(0, 0, 1) : Vec3(0, 1, 0);
    camera.toWorld = glm::inverse(glm::lookAt(eye, target, up));
    camera.orthographic = false;
  }
  if (c.yfovDegrees > 0) {
    camera.yfov = glm::radians(static_cast<float>(c.yfovDegrees));
    camera.orthographic = false;
  }
  return camera;
}

Settings makeSettings(const SceneChoice& scene, const SampleChoice& samples) {
  Settings s;
  std::tie(s.width, s.height) = parseSize(scene.size);
  if (!scene.crop.empty()) s.crop = parseWindow(scene.crop);
  if (!scene.background.empty()) {
    const std::vector<double> n = parseBackground(scene.background);
    s.background = Spectrum(n[0], n[1], n[2]);
  }
  s.full = scene.full;
  s.integrators = splitList(samples.integrators);
  s.seconds = samples.time.empty() ? 0 : parseDuration(samples.time);
  s.spp = samples.spp > 0 ? samples.spp : samples.time.empty() ? 64 : 0;
  s.maxDepth = samples.maxDepth;
  s.seed = samples.seed;
  s.sampler = choose<SamplerKind>(samples.sampler, "sampler",
                                  {{"sobol", SamplerKind::Sobol}, {"independent", SamplerKind::Independent}});
  s.filter = choose<PixelFilter>(samples.filter, "filter",
                                 {{"box", PixelFilter::Box},
                                  {"gaussian", PixelFilter::Gaussian},
                                  {"blackman-harris", PixelFilter::BlackmanHarris}});
  s.lightStrategy = choose<LightStrategy>(
      samples.lights, "light strategy",
      {{"auto", LightStrategy::Automatic}, {"power", LightStrategy::Power}, {"hierarchy", LightStrategy::Hierarchy}});
  s.threads = samples.threads;
  s.clamp = static_cast<float>(samples.clamp);
  s.photons = samples.photons;
  s.photonRadius = static_cast<float>(samples.photonRadius);
  s.photonDirect = samples.photonDirect;
  s.photonAiming = !samples.noPhotonAiming;
  return s;
}

}  // namespace braid
