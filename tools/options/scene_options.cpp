// SPDX-License-Identifier: Apache-2.0
#include "tools/options/scene_options.h"

#include <tuple>

#include <CLI/CLI.hpp>

#include "renderer/session/pixel_filter.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"

namespace braid {

namespace {

const std::vector<std::pair<std::string, SamplerKind>> kSamplers{{"sobol", SamplerKind::Sobol},
                                                                 {"independent", SamplerKind::Independent}};
const std::vector<std::pair<std::string, PixelFilter>> kFilters{
    {"box", PixelFilter::Box}, {"gaussian", PixelFilter::Gaussian}, {"blackman-harris", PixelFilter::BlackmanHarris}};
const std::vector<std::pair<std::string, LightStrategy>> kLights{
    {"auto", LightStrategy::Automatic}, {"power", LightStrategy::Power}, {"hierarchy", LightStrategy::Hierarchy}};

const std::vector<std::pair<std::string, Guiding>> kGuidings{
    {"auto", Guiding::Automatic}, {"on", Guiding::On}, {"off", Guiding::Off}};

const std::vector<std::pair<std::string, DefaultLight>> kDefaultLights{
    {"studio", DefaultLight::Studio}, {"dome", DefaultLight::Dome}, {"none", DefaultLight::None}};
const std::vector<std::pair<std::string, bool>> kOnOff{{"on", true}, {"off", false}};

void addViewOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("--camera", c.camera, "Camera by name or index (default: the first)")->type_name("NAME");
  addParsed(command, "--look-at", c.lookAt, parseLookAt, "Eye and target instead of the file's camera, in metres")
      ->type_name("ox,oy,oz,tx,ty,tz");
  command.add_option("--yfov", c.yfovDegrees, "Vertical field of view in degrees")
      ->check(number(0, 180, Ends::Excluded));
  addParsed(command, "--aperture", c.aperture, parseAperture,
            "Depth of field: the lens's width as f/N (of a camera with a frame 24 mm high) or in metres (default: 0)")
      ->type_name("f/N|METRES");
  addParsed(command, "--focus", c.focus, parseFocus,
            "What is sharp: metres along the view, or what this pixel sees (default: the middle of the frame)")
      ->type_name("METRES|X,Y");
}

void addFrameOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("--scene", c.frameScene, "Index of the glTF scene to render")->check(wholeNumber(0, 1000000));
  command.add_option("--variant", c.load.variant, "Material variant by name (KHR_materials_variants)")
      ->type_name("NAME");
  command
      .add_option("--frame-time", c.frameTime,
                  "Pose of skins, morphs and nodes at this time of an animation, in seconds")
      ->check(number(0, 1e9));
  command
      .add_option("--shutter", c.load.shutter,
                  "Motion blur: the shutter is open for so many seconds from the frame's time on; with 24 frames a "
                  "second 180 degrees are 1/48 s = 0.0208 (default: 0)")
      ->check(number(0, 1e9));
  command.add_option("--animation", c.load.animation, "Animation by name or index (default: the first)")
      ->type_name("NAME");
}

void addLightOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("--env", c.environment, "Environment image, latitude-longitude (.hdr, .exr, ...)")
      ->type_name("FILE");
  command
      .add_option("--env-rotate", c.environmentRotation,
                  "Turn the environment about +Y, degrees; at 0 its centre lies in +X, as in three.js and Blender")
      ->check(number(-36000, 36000));
  command.add_option("--env-scale", c.environmentScale, "Multiply the environment")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  addParsed(command, "--background", c.background, parseBackground,
            "Radiance seen by camera rays that miss, instead of the environment")
      ->type_name("r,g,b");
  command.add_option("--light-scale", c.lightScale, "Multiply every light and emitter of the file")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  addNamed(
      command, "--default-light", c.defaultLight, {"default light", kDefaultLights},
      "Where the file's lights leave the picture dark: studio (soft boxes, a neutral backdrop), dome (grey), none");
  command.add_flag("--ground", c.ground,
                   "A matte ground under the scene that shows its shadows and has the colour of the backdrop; with "
                   "--transparent its alpha is the shadow");
  command.add_flag_callback(
      "--no-default-light", [&c] { c.defaultLight = DefaultLight::None; }, "--default-light none");
}

void addLoadOptions(CLI::App& command, SceneChoice& c) {
  command.add_flag("--allow-external", c.load.allowExternal,
                   "Read files outside of the scene's folder too: ../, absolute paths, symbolic links");
  command.add_flag("--strict", c.load.strict, "Refuse a file with any problem, listing all of them (exit code 2)");
  command
      .add_option("--ignore-extension", c.load.ignoredExtensions,
                  "Render although the file requires this unknown extension (repeatable)")
      ->allow_extra_args(false)
      ->type_name("NAME");
  command
      .add_option("--point-radius", c.load.pointRadius,
                  "Draw points and lines as spheres and rods of this radius in metres (default: they are left out)")
      ->check(number(1e-12, 1e9));
  command.add_flag("--double-sided", c.load.doubleSided, "Treat every material as double-sided");
  addNamed(
      command, "--multi-scatter", c.load.multiScatter, {"choice", kOnOff},
      "on: rough metals and rough glass keep the light that glTF's reference, of single scattering, loses; off: as "
      "the reference");
  command.add_flag("--full", c.full, "Leave nothing out that the scene does not need (same pixels, for checking)");
  addIsa(command, c.isa);
}

void addPhotonOptions(CLI::App& command, SampleChoice& c) {
  command.add_option("--photons", c.photons, "Light paths of a photon mapping pass (default: one per pixel)")
      ->check(wholeNumber(1, uint64_t(1) << 28));
  command.add_option("--photon-radius", c.photonRadius, "First gather radius of photon mapping, in pixels")
      ->capture_default_str()
      ->check(number(0.01, 1000));
  command.add_flag("--photon-direct", c.photonDirect, "Photon mapping for direct light too");
  command.add_flag("--no-photon-aiming", c.noPhotonAiming,
                   "Choose photons' lights by power alone, not also by what arrives where the camera looks");
}

}  // namespace

const char* toString(DefaultLight light) {
  for (const auto& [name, one] : kDefaultLights)
    if (one == light) return name.c_str();
  return "";
}

const char* toString(SamplerKind sampler) { return sampler == SamplerKind::Sobol ? "sobol" : "independent"; }

CLI::Option* addSize(CLI::App& command, FrameSize& size, const char* description) {
  return addParsed(command, "--size", size, parseSize, description)
      ->default_str(toString(size))
      ->type_name("WIDTHxHEIGHT");
}

CLI::Option* addSampler(CLI::App& command, SamplerKind& sampler) {
  return addNamed(command, "--sampler", sampler, {"sampler", kSamplers}, "sobol or independent");
}

CLI::Option* addIsa(CLI::App& command, std::string& isa) {
  return command.add_option("--isa", isa, "Instruction set for Embree: avx2, avx512, sse4.2, or 'auto'")
      ->capture_default_str()
      ->type_name("NAME");
}

void addSceneViewOptions(CLI::App& command, SceneChoice& c) {
  addViewOptions(command, c);
  addFrameOptions(command, c);
  addLightOptions(command, c);
  addLoadOptions(command, c);
}

void addSceneOptions(CLI::App& command, SceneChoice& c) {
  command.add_option("SCENE", c.file, "glTF 2.0 file, .gltf or .glb")->required()->type_name("FILE");
  addSize(command, c.size, "Full frame in pixels");
  addParsed(command, "--crop", c.crop, parseWindow, "Only this part of the frame: upper left origin, ends excluded")
      ->type_name("x0,y0,x1,y1");
  addSceneViewOptions(command, c);
  command.add_flag("-q,--quiet", c.quiet, "Errors only");
  command.add_flag("-v,--verbose", c.verbose, "Also print the plan");
  showFirst(command, kSceneHelp, {"--size", "--crop", "--camera", "--look-at", "--env"});
  showFirst(command, kMessageHelp, {"--quiet", "--verbose"});
}

void addSampleOptions(CLI::App& command, SampleChoice& c) {
  addList(command, "--integrator", c.integrators, "Integrators, separated by commas, or auto");
  command.add_option("--spp", c.spp, "Samples per pixel of each integrator (default 64 without --time)")
      ->check(wholeNumber(1, kMostSamples));
  addParsed(command, "--time", c.seconds, parseLimit, "Stop after this wall-clock time: 90, 90s, 2m, 1h")
      ->type_name("DURATION");
  command.add_option("--max-depth", c.maxDepth, "Longest path in segments, the camera's included")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000000));
  command.add_option("--seed", c.seed, "Seed of the random numbers")->capture_default_str()->check(anySeed());
  addSampler(command, c.sampler);
  addNamed(command, "--filter", c.filter, {"filter", kFilters}, "Pixel filter: box, gaussian or blackman-harris");
  addNamed(command, "--lights", c.lights, {"light strategy", kLights},
           "How lights are chosen: auto, power or hierarchy");
  addNamed(command, "--guiding", c.guiding, {"guiding", kGuidings},
           "Whether pt learns where light comes from: auto (where it pays), on or off");
  command.add_option("--light-samples", c.lightSamples, "Lights that a path of pt samples at its first surface")
      ->default_str("as many as pay")
      ->check(wholeNumber(1, kMostLightSamples));
  command
      .add_option("--path-splits", c.pathSplits,
                  "Directions that a path of pt goes on in from its first surface; 0: as many as pay")
      ->capture_default_str()
      ->check(wholeNumber(0, kMostPathSplits));
  addThreads(command, c.threads);
  command.add_option("--clamp", c.clamp, "Clamp a path's radiance (biased; 0: off)")
      ->capture_default_str()
      ->check(number(0, kLargeNumber));
  addPhotonOptions(command, c);
  showFirst(command, kSampleHelp, {"--integrator", "--spp", "--time", "--max-depth", "--seed", "--threads"});
}

void addPlacement(CLI::App& command, SampleChoice& c) {
  command.add_flag("--place-samples", c.placeSamples,
                   "Send the samples of pt where the combined image errs most for what they cost, --spp on average");
}

Settings makeSettings(const SceneChoice& scene, const SampleChoice& samples) {
  Settings s;
  s.width = scene.size.width;
  s.height = scene.size.height;
  s.crop = scene.crop;
  s.background = scene.background;
  s.full = scene.full;
  s.integrators = samples.integrators;
  s.seconds = samples.seconds;
  s.spp = samples.spp > 0 ? samples.spp : samples.seconds > 0 ? 0 : 64;
  s.maxDepth = samples.maxDepth;
  s.seed = samples.seed;
  s.sampler = samples.sampler;
  s.filter = samples.filter;
  s.lightStrategy = samples.lights;
  s.guiding = samples.guiding;
  s.lightSamples = samples.lightSamples;
  s.pathSplits = samples.pathSplits;
  s.threads = samples.threads;
  s.clamp = static_cast<float>(samples.clamp);
  s.photons = samples.photons;
  s.photonRadius = static_cast<float>(samples.photonRadius);
  s.photonDirect = samples.photonDirect;
  s.photonAiming = !samples.noPhotonAiming;
  return s;
}

}  // namespace braid
