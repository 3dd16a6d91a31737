// SPDX-License-Identifier: Apache-2.0
#include "tools/cli.h"

#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "renderer/session/default_light.h"

namespace braid {

namespace {

// Comma-separated numbers; throws Error(Usage) naming the option when there are not `count` of them.
std::vector<double> parseNumbers(const std::string& text, size_t count, const char* option) {
  std::vector<double> numbers;
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string item = text.substr(begin, end - begin);
    size_t used = 0;
    double value = 0;
    try {
      value = std::stod(item, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used == 0 || used != item.size() || !std::isfinite(value))
      numbers.assign(count + 1, 0.0);
    else
      numbers.push_back(value);
    begin = end + 1;
  }
  if (numbers.size() != count)
    throw Error(ExitCode::Usage, fmt::format("{} '{}': expected {} numbers separated by commas", option, text, count));
  return numbers;
}

std::pair<int, int> parseSize(const std::string& text) {
  int width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width <= 0 || height <= 0)
    throw Error(ExitCode::Usage, "--size '" + text + "': expected WIDTHxHEIGHT in pixels, such as 1280x720");
  if (static_cast<int64_t>(width) * height > (int64_t(1) << 28) || width > 65536 || height > 65536)
    throw Error(ExitCode::Usage, "--size '" + text + "': at most 65536 pixels a side and 268 million in all");
  return {width, height};
}

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

std::vector<std::string> splitList(const std::string& text) {
  std::vector<std::string> list;
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) list.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return list;
}

double parseDuration(const std::string& text) {
  double total = 0;
  const char* p = text.c_str();
  bool any = false;
  while (*p) {
    char* end = nullptr;
    const double value = std::strtod(p, &end);
    if (end == p || !(value >= 0) || !std::isfinite(value)) break;
    const double unit = *end == 'h' ? 3600 : *end == 'm' ? 60 : 1;
    p = *end == 'h' || *end == 'm' || *end == 's' ? end + 1 : end;
    total += value * unit;
    any = true;
  }
  if (!any || *p) throw Error(ExitCode::Usage, "duration '" + text + "': expected such as 90, 90s, 2m, 1h or 1h30m");
  return total;
}

void addSceneOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("SCENE", c.file, "glTF 2.0 file, .gltf or .glb")->required();
  command.add_option("--size", c.size, "Full frame in pixels, WIDTHxHEIGHT")->capture_default_str();
  command.add_option("--crop", c.crop,
                     "Render only x0,y0,x1,y1 of the full frame (pixels, upper left origin, ends excluded)");
  command.add_option("--camera", c.camera, "Camera by name or index (default: the first)");
  command.add_option("--look-at", c.lookAt, "Eye and target instead of the file's camera: ox,oy,oz,tx,ty,tz in metres");
  command.add_option("--yfov", c.yfovDegrees, "Vertical field of view in degrees");
  command.add_option("--scene", c.frameScene, "Index of the glTF scene to render");
  command.add_option("--variant", c.load.variant, "Material variant by name (KHR_materials_variants)");
  command.add_option("--frame-time", c.frameTime,
                     "Pose of skins, morphs and nodes at this time of an animation, in seconds");
  command.add_option("--animation", c.load.animation, "Animation by name or index (default: the first)");
  command.add_option("--env", c.environment, "Environment image, latitude-longitude (.hdr, .exr, ...)");
  command.add_option("--env-rotate", c.environmentRotation,
                     "Turn the environment about +Y, degrees; at 0 its centre lies in +X, as in three.js and Blender");
  command.add_option("--env-scale", c.environmentScale, "Multiply the environment")->capture_default_str();
  command.add_option("--background", c.background,
                     "Radiance r,g,b seen by camera rays that miss, instead of the environment");
  command.add_option("--light-scale", c.lightScale, "Multiply every light and emitter of the file")
      ->capture_default_str();
  command.add_flag("--no-default-light", c.noDefaultLight,
                   "No grey dome where the file's lights leave the picture dark");
  command.add_flag("--allow-external", c.load.allowExternal,
                   "Read files outside of the scene's folder too: ../, absolute paths, symbolic links");
  command.add_flag("--strict", c.load.strict, "Refuse a file with any problem, listing all of them (exit code 2)");
  command
      .add_option("--ignore-extension", c.load.ignoredExtensions,
                  "Render although the file requires this unknown extension (repeatable)")
      ->allow_extra_args(false);
  command.add_flag("--double-sided", c.load.doubleSided, "Treat every material as double-sided");
  command.add_flag("--full", c.full, "Leave nothing out that the scene does not need (same pixels, for checking)");
  command.add_option("--isa", c.isa, "Instruction set for Embree: avx2, avx512, sse4.2, or 'auto'")
      ->capture_default_str();
  command.add_flag("-q,--quiet", c.quiet, "Errors only");
  command.add_flag("-v,--verbose", c.verbose, "Also print the plan");
}

void addSampleOptions(CLI::App& command, SampleChoice& c) {
  command.add_option("--integrator", c.integrators, "Integrators, separated by commas, or auto")->capture_default_str();
  command.add_option("--spp", c.spp, "Samples per pixel of each integrator (default 64 unless --time is given)");
  command.add_option("--time", c.time, "Stop after this wall-clock time: 90, 90s, 2m, 1h");
  command.add_option("--max-depth", c.maxDepth, "Longest path in segments, the camera's included")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command.add_option("--seed", c.seed, "Seed of the random numbers")->capture_default_str();
  command.add_option("--sampler", c.sampler, "sobol or independent")->capture_default_str();
  command.add_option("--filter", c.filter, "Pixel filter: box, gaussian or blackman-harris")->capture_default_str();
  command.add_option("--lights", c.lights, "How lights are chosen: auto, power or hierarchy")->capture_default_str();
  command.add_option("--threads", c.threads, "Worker threads (default: all)")->check(CLI::Range(0, 4096));
  command.add_option("--clamp", c.clamp, "Clamp a path's radiance (biased; off by default)")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--photons", c.photons, "Light paths of a photon mapping pass (default: one per pixel)")
      ->check(CLI::Range(uint64_t(1), uint64_t(1) << 28));
  command.add_option("--photon-radius", c.photonRadius, "First gather radius of photon mapping, in pixels")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1000.0));
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
    const std::vector<double> n = parseNumbers(c.lookAt, 6, "--look-at");
    const glm::dvec3 o = data.origin;
    const Vec3 eye(n[0] - o.x, n[1] - o.y, n[2] - o.z), target(n[3] - o.x, n[4] - o.y, n[5] - o.z);
    if (eye == target) throw Error(ExitCode::Usage, "--look-at: eye and target are the same point");
    const Vec3 forward = glm::normalize(target - eye);
    const Vec3 up = std::abs(forward.y) > 0.999f ? Vec3(0, 0, 1) : Vec3(0, 1, 0);
    camera.toWorld = glm::inverse(glm::lookAt(eye, target, up));
    camera.orthographic = false;
  }
  if (c.yfovDegrees > 0) {
    if (c.yfovDegrees >= 180) throw Error(ExitCode::Usage, "--yfov: must be below 180 degrees");
    camera.yfov = glm::radians(static_cast<float>(c.yfovDegrees));
    camera.orthographic = false;
  }
  return camera;
}

Settings makeSettings(const SceneChoice& scene, const SampleChoice& samples) {
  Settings s;
  std::tie(s.width, s.height) = parseSize(scene.size);
  if (!scene.crop.empty()) {
    const std::vector<double> n = parseNumbers(scene.crop, 4, "--crop");
    s.crop =
        PixelWindow{static_cast<int>(n[0]), static_cast<int>(n[1]), static_cast<int>(n[2]), static_cast<int>(n[3])};
  }
  if (!scene.background.empty()) {
    const std::vector<double> n = parseNumbers(scene.background, 3, "--background");
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
