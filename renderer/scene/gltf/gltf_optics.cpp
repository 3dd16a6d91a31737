// SPDX-License-Identifier: Apache-2.0
// Cameras and punctual lights of a file as plain data, at the origin; the image-based light of the scene.
#include <algorithm>
#include <cmath>

#include "renderer/scene/data/cube_environment.h"
#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/gltf_images.h"

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

// One that the scene refers to, whose flaws cost it alone.
class ImageBasedLight {
 public:
  ImageBasedLight(Document& document, const Value& light, std::string place)
      : document_(document), light_(light), place_(std::move(place)) {}

  std::optional<EnvironmentData> read() {
    const double intensity = number(light_, "intensity", 1);
    readCoefficients();
    EnvironmentData environment;
    environment.radiance = Spectrum(static_cast<float>(intensity));
    environment.ofFile = true;
    if (std::optional<CubeFaces> faces = readFaces()) {
      const CubeLayout layout = layoutOf(*faces);
      if (layout != CubeLayout::Mirrored)
        document_.report.warn(place_ + "/specularImages",
                              "faces do not meet as the specification mirrors them, but as OpenGL has them, upright or "
                              "upside down; they are read so");
      environment.image = cubeEnvironment(*faces, layout, rotation());
    } else if (coefficients_) {
      environment.image = irradianceEnvironment(*coefficients_, rotation());
    } else {
      return {};
    }
    const std::vector<float>& radiance = environment.image->floats;
    if (intensity > 0 && std::any_of(radiance.begin(), radiance.end(), [](float v) { return v > 0; }))
      return environment;
    document_.report.warn(place_, "a light is black; it is left out");
    return {};
  }

 private:
  void readCoefficients() {
    const Value& rows = member(light_, "irradianceCoefficients");
    IrradianceCoefficients all{};
    bool good = rows.ArrayLen() == all.size();
    for (size_t k = 0; good && k < all.size(); ++k) {
      const Value& row = rows.Get(static_cast<int>(k));
      good = row.ArrayLen() == 3;
      for (size_t c = 0; good && c < 3; ++c)
        all[k][static_cast<int>(c)] = static_cast<float>(row.Get(static_cast<int>(c)).GetNumberAsDouble());
    }
    if (good) coefficients_ = all;
  }

  const char* meanwhile() const {
    return coefficients_ ? "its irradiance coefficients light the scene, without detail" : "the light is left out";
  }

  std::nullopt_t refuse(const std::string& place, const std::string& text) {
    document_.report.problem(place, text, meanwhile());
    return std::nullopt;
  }

  // Those of the first level; the others are blurred copies of it.
  std::optional<CubeFaces> readFaces() {
    const std::string place = place_ + "/specularImages/0";
    const Value& levels = member(light_, "specularImages");
    if (levels.ArrayLen() == 0 || levels.Get(0).ArrayLen() != 6)
      return refuse(place, "lists no six images; write one for each face of the cube");
    std::vector<int> images;
    for (int k = 0; k < 6; ++k) {
      images.push_back(levels.Get(0).Get(k).GetNumberAsInt());
      if (images.back() < 0) return refuse(place, "names an image that does not exist; write one for each face");
    }
    const std::vector<std::shared_ptr<const Image>> read = ImageTable(document_, {}).read(images, meanwhile());
    CubeFaces faces;
    for (size_t k = 0; k < 6; ++k) {
      if (!read[k]) return refuse(place, "has a face without pixels; mend its image");
      faces[k] = read[k];
      const int width = read[k]->width, height = read[k]->height;
      if (width != height || width != read[0]->width)
        return refuse(place + '/' + std::to_string(k), "is " + std::to_string(width) + " x " + std::to_string(height) +
                                                           " pixels; the faces of a cube are squares of one size");
    }
    return faces;
  }

  glm::dmat3 rotation() {
    const Value& r = member(light_, "rotation");
    if (r.ArrayLen() != 4) return glm::dmat3(1);
    const auto at = [&](int k) { return r.Get(k).GetNumberAsDouble(); };
    const glm::dquat q(at(3), at(0), at(1), at(2));
    if (glm::length(q) > 1e-6) return glm::mat3_cast(glm::normalize(q));
    document_.report.warn(place_ + "/rotation", "is zero; no rotation is used");
    return glm::dmat3(1);
  }

  Document& document_;
  const Value& light_;
  std::string place_;
  std::optional<IrradianceCoefficients> coefficients_;
};

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

void readImageBasedLight(Document& document) {
  constexpr const char* kName = "EXT_lights_image_based";
  const size_t chosen = static_cast<size_t>(std::max(document.options.scene.value_or(document.model.defaultScene), 0));
  if (chosen >= document.model.scenes.size()) return;
  const int light = index(member(document.model.scenes[chosen].extensions, kName), "light");
  if (light < 0) return;
  const std::string place = std::string("/extensions/") + kName + "/lights/" + std::to_string(light);
  if (!document.options.imageBasedLight) {
    document.report.warn(place, "the light of the scene is left out: another environment is given");
    return;
  }
  document.usage.mark("image-based lights", light);
  const Value& lights = member(member(document.model.extensions, kName), "lights");
  document.environment = ImageBasedLight(document, lights.Get(light), place).read();
  if (document.environment) document.count(FilePart::ImageBasedLight);
}

}  // namespace braid::gltf
