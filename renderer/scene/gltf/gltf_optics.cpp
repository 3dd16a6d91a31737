// SPDX-License-Identifier: Apache-2.0
// Cameras and punctual lights of a file as plain data, at the origin.
#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

namespace {

float positive(Report& report, const std::string& place, double value, float fallback, const char* what) {
  if (value > 0) return static_cast<float>(value);
  report.problem(place, std::string("is not positive; write ") + what, "a usual value is used");
  return fallback;
}

float halfExtent(Report& report, const std::string& place, double value) {
  if (value < 0) report.warn(place, "is negative; its absolute value is used");
  if (value == 0) report.problem(place, "is 0; write half the extent of the view in metres", "a usual value is used");
  return value == 0 ? 1 : static_cast<float>(std::abs(value));
}

void readPerspective(Report& report, const std::string& place, const tinygltf::PerspectiveCamera& source,
                     CameraData& camera) {
  camera.yfov = positive(report, place + "/yfov", source.yfov, camera.yfov, "an angle in radians");
  if (camera.yfov >= kPi) {
    report.problem(place + "/yfov", "is at least pi; write an angle in radians below 3.14159", "0.8 is used");
    camera.yfov = 0.8f;
  }
  // 0: none.
  if (source.aspectRatio > 0) camera.aspect = static_cast<float>(source.aspectRatio);
  // Planes do not clip a path tracer; they are only checked.
  if (source.znear <= 0)
    report.warn(place + "/znear", "a camera's znear is not positive; clipping planes are ignored anyway");
}

void readCone(Report& report, const std::string& place, const tinygltf::SpotLight& source, PunctualLight& light) {
  light.outerConeAngle = static_cast<float>(source.outerConeAngle);
  light.innerConeAngle = static_cast<float>(source.innerConeAngle);
  if (light.innerConeAngle < light.outerConeAngle) return;
  report.warn(place + "/spot/innerConeAngle",
              "a light's inner cone is not smaller than its outer cone; it is narrowed");
  light.innerConeAngle = light.outerConeAngle * 0.999f;
}

}  // namespace

CameraData readCamera(Document& document, const tinygltf::Camera& source, size_t index) {
  const std::string place = "/cameras/" + std::to_string(index) + '/' + source.type;
  CameraData camera;
  camera.name = source.name;
  if (source.type == "perspective") {
    readPerspective(document.report, place, source.perspective, camera);
  } else {
    camera.orthographic = true;
    camera.xmag = halfExtent(document.report, place + "/xmag", source.orthographic.xmag);
    camera.ymag = halfExtent(document.report, place + "/ymag", source.orthographic.ymag);
  }
  return camera;
}

PunctualLight readLight(Document& document, const tinygltf::Light& source, size_t index) {
  const std::string place = "/extensions/KHR_lights_punctual/lights/" + std::to_string(index);
  Report& report = document.report;
  PunctualLight light;
  light.name = source.name;
  glm::dvec3 color(1);
  if (source.color.size() == 3) color = {source.color[0], source.color[1], source.color[2]};
  if (std::min({color.x, color.y, color.z}) < 0) report.warn(place + "/color", "is negative; 0 is used");
  const glm::dvec3 intensity = glm::max(color, glm::dvec3(0)) * source.intensity;
  constexpr double kMost = std::numeric_limits<float>::max();
  if (std::max({intensity.x, intensity.y, intensity.z}) > kMost)
    report.problem(place + "/intensity", "times color is too large; write a smaller number", "the largest one is used");
  light.intensity = Spectrum(glm::min(intensity, glm::dvec3(kMost)));
  if (source.type == "directional") {
    light.kind = PunctualKind::Directional;
    return light;
  }
  if (source.type == "spot") {
    light.kind = PunctualKind::Spot;
    readCone(report, place, source.spot, light);
  }
  // 0: none. JSON cannot write infinity: the largest float stands for it.
  if (source.range > 0 && source.range < kMost) light.range = static_cast<float>(source.range);
  return light;
}

void readCamerasAndLights(Document& document) {
  for (size_t i = 0; i < document.model.cameras.size(); ++i)
    document.cameras.push_back(readCamera(document, document.model.cameras[i], i));
  for (size_t i = 0; i < document.model.lights.size(); ++i)
    document.lights.push_back(readLight(document, document.model.lights[i], i));
}

}  // namespace braid::gltf
