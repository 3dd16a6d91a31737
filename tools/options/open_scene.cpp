// SPDX-License-Identifier: Apache-2.0
#include "tools/options/open_scene.h"

#include <cstdio>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "renderer/session/default_light.h"

namespace braid {

namespace {

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

}  // namespace

OpenedScene openScene(const SceneChoice& choice) {
  const Stopwatch clock;
  SceneData data = loadScene(choice);
  OpenedScene opened;
  opened.loadSeconds = clock.seconds();
  opened.camera = chooseCamera(data, choice);
  opened.scene = buildScene(std::move(data), choice, opened.camera);
  return opened;
}

SceneData loadScene(const SceneChoice& c) {
  LoadOptions options = c.load;
  options.defaultLight = !c.noDefaultLight && c.environment.empty();
  options.keepAllAttributes = c.full;
  options.camera = c.lookAt ? "none" : c.camera;
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
  return data;
}

std::unique_ptr<Scene> buildScene(SceneData data, const SceneChoice& c, const CameraData& camera) {
  SceneOptions options;
  options.isa = c.isa == "auto" ? "" : c.isa;
  options.full = c.full;
  auto scene = std::make_unique<Scene>(std::move(data), options);
  if (c.noDefaultLight || !c.environment.empty()) return scene;
  const std::optional<std::string> warning =
      lightIfDark(*scene, camera, c.size.width, c.size.height, static_cast<float>(c.lightScale));
  if (warning && !c.quiet) fmt::print(stderr, "warning: {}: {}\n", c.file, *warning);
  return scene;
}

CameraData chooseCamera(const SceneData& data, const SceneChoice& c) {
  CameraData camera;
  if (!data.cameras.empty()) camera = data.cameras[0];
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
