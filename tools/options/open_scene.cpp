// SPDX-License-Identifier: Apache-2.0
#include "tools/options/open_scene.h"

#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "renderer/scene/camera.h"
#include "renderer/scene/data/ground.h"
#include "renderer/scene/data/scene_defaults.h"
#include "renderer/session/default_light.h"

namespace braid {

namespace {

// Of the film or sensor that f-numbers are meant for: 36 x 24 mm.
constexpr double kFrameHeight = 0.024;

// The camera of the file that the choice names.
const CameraData& namedCamera(const SceneData& data, const SceneChoice& c) {
  std::string known;
  for (size_t i = 0; i < data.cameras.size(); ++i) {
    const std::string& name = data.cameras[i].name;
    if (name == c.camera || std::to_string(i) == c.camera) return data.cameras[i];
    known += fmt::format("{}{} '{}'", known.empty() ? "" : ", ", i, name);
  }
  throw Error(ExitCode::Usage,
              fmt::format("no camera '{}' in {}: it has {}", c.camera, c.file, known.empty() ? "none" : known));
}

// How far along the view the first surface in the middle of a pixel lies.
double depthAt(const Scene& scene, const CameraData& data, const SceneChoice& c, const std::pair<int, int>& pixel) {
  const auto& [x, y] = pixel;
  const Camera camera(data, c.size.width, c.size.height);
  const Camera::CameraRay ray = camera.ray({static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f});
  RayBatch rays;
  RayHit hit;
  rays.set(0, {ray.origin, ray.direction, kInfinity, kCameraRay});
  scene.accel().intersect(rays, 1, &hit);
  if (!(hit.t < kInfinity))
    throw Error(ExitCode::Usage, fmt::format("--focus: pixel {},{} of {} sees nothing: give metres, or another pixel",
                                             x, y, toString(c.size)));
  return static_cast<double>(hit.t * glm::dot(ray.direction, camera.forward()));
}

LoadOptions loadOptions(const SceneChoice& c) {
  LoadOptions options = c.load;
  options.defaultLight = c.environment.empty() ? c.defaultLight : DefaultLight::None;
  options.imageBasedLight = c.environment.empty();
  options.keepAllAttributes = c.full;
  options.camera = c.lookAt ? "none" : c.camera;
  if (c.frameScene >= 0) options.scene = c.frameScene;
  if (c.frameTime >= 0) options.frameTime = static_cast<float>(c.frameTime);
  if (c.load.shutter > 0 && !options.frameTime)
    throw Error(ExitCode::Usage,
                "--shutter: nothing moves in the pose at rest: give --frame-time SECONDS, or --frames to a render");
  return options;
}

// A pose may hide everything for a while, and an environment is worth a look by itself.
void refuseNothing(const SceneData& data, const SceneChoice& c, double frameTime) {
  if (!data.instances.empty() || frameTime >= 0 || (data.environment && !data.defaultLight)) return;
  throw Error(ExitCode::BadInput,
              c.file +
                  ": there is nothing to render: no triangles and no environment; give --env, or --point-radius "
                  "where the file has points or lines");
}

LogSink sinkOf(const SceneChoice& c) {
  return [quiet = c.quiet](LogLevel level, const std::string& line) {
    if (!quiet && level == LogLevel::Warning) fmt::print(stderr, "warning: {}\n", line);
  };
}

}  // namespace

void fitLens(const Scene& scene, const SceneChoice& c, CameraData& camera) {
  if (!c.aperture) {
    if (c.focus) throw Error(ExitCode::Usage, "--focus: everything is sharp without --aperture: give it");
    return;
  }
  if (camera.orthographic)
    throw Error(ExitCode::Usage,
                "--aperture: an orthographic camera has no lens: choose another (--camera, --look-at)");
  const std::pair<int, int> middle(c.size.width / 2, c.size.height / 2);
  const bool byDistance = c.focus && !c.focus->pixel;
  camera.focusDistance =
      static_cast<float>(byDistance ? c.focus->metres : depthAt(scene, camera, c, c.focus ? *c.focus->pixel : middle));
  const double focalLength = 0.5 * kFrameHeight / std::tan(0.5 * static_cast<double>(camera.yfov));
  const double width = c.aperture->fNumber > 0 ? focalLength / c.aperture->fNumber : c.aperture->metres;
  camera.lensRadius = static_cast<float>(0.5 * width);
}

SceneOpener::SceneOpener(const SceneChoice& choice)
    : choice_(choice), file_(choice.file, loadOptions(choice), sinkOf(choice)) {}

SceneData SceneOpener::load(double frameTime) {
  const SceneChoice& c = choice_;
  SceneData data = file_.pose(frameTime >= 0 ? std::optional(static_cast<float>(frameTime)) : std::nullopt);
  const auto scale = static_cast<float>(c.lightScale);
  if (!c.environment.empty()) {
    if (!environment_) environment_ = readImageFile(c.environment);
    EnvironmentData e;
    e.image = environment_;
    e.radiance = Spectrum(static_cast<float>(c.environmentScale));
    e.rotation = glm::radians(static_cast<float>(c.environmentRotation));
    data.environment = e;
  } else if (data.environment) {
    data.environment->radiance *= scale;
    if (data.environment->ofFile) {
      data.environment->radiance *= static_cast<float>(c.environmentScale);
      data.environment->rotation = glm::radians(static_cast<float>(c.environmentRotation));
    }
    if (data.backdrop) *data.backdrop *= scale;
  }
  for (Material& m : data.materials) m.emission *= scale;
  for (PunctualLight& l : data.lights) l.intensity *= scale;
  return data;
}

OpenedScene SceneOpener::open(double frameTime) {
  const Stopwatch clock;
  SceneData data = load(frameTime);
  refuseNothing(data, choice_, frameTime);
  OpenedScene opened;
  opened.loadSeconds = clock.seconds();
  opened.camera = chooseCamera(data, choice_);
  if (choice_.ground) addGround(data);
  opened.scene = buildScene(std::move(data), choice_, opened.camera);
  fitLens(*opened.scene, choice_, opened.camera);
  return opened;
}

OpenedScene openScene(const SceneChoice& choice) {
  const Stopwatch clock;
  SceneOpener source(choice);
  const double readSeconds = clock.seconds();
  OpenedScene opened = source.open(choice.frameTime);
  opened.loadSeconds += readSeconds;
  return opened;
}

SceneData loadScene(const SceneChoice& choice) { return SceneOpener(choice).load(choice.frameTime); }

std::unique_ptr<Scene> buildScene(SceneData data, const SceneChoice& c, const CameraData& camera) {
  SceneOptions options;
  options.isa = c.isa == "auto" ? "" : c.isa;
  options.full = c.full;
  auto scene = std::make_unique<Scene>(std::move(data), options);
  const std::optional<std::string> warning =
      lightIfDark(*scene, camera, c.size.width, c.size.height, static_cast<float>(c.lightScale), c.defaultLight);
  if (warning && !c.quiet) fmt::print(stderr, "warning: {}: {}\n", c.file, *warning);
  return scene;
}

CameraData chooseCamera(const SceneData& data, const SceneChoice& c) {
  CameraData camera;
  if (!data.cameras.empty()) camera = data.cameras[0];
  if (data.defaultCamera && !c.lookAt)
    camera =
        framingCamera(data, static_cast<float>(c.size.width) / static_cast<float>(c.size.height),
                      c.yfovDegrees > 0 ? glm::radians(static_cast<float>(c.yfovDegrees)) : kDefaultYfov, c.turntable);
  if (!c.camera.empty()) camera = namedCamera(data, c);
  if (c.lookAt) {
    const Vec3 eye(c.lookAt->eye - data.origin), target(c.lookAt->target - data.origin);
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

}  // namespace braid
