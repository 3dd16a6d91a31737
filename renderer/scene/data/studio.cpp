// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/studio.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

constexpr int kWidth = 256, kHeight = 128;
// The brightest of the paper, at the horizon: what is brighter is a box.
constexpr float kPaper = 0.5f;
constexpr float kSoftEdge = 0.07f;  // of a box, as a tangent

float smooth(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

// Angles in degrees: where it stands, from +Z toward +X and up, and half its size.
struct SoftBox {
  float azimuth, elevation, halfWidth, halfHeight, radiance;

  float at(const Vec3& d) const {
    const float a = glm::radians(azimuth), e = glm::radians(elevation);
    const Vec3 centre(std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e));
    const Vec3 right(std::cos(a), 0, -std::sin(a)), up = glm::cross(centre, right);
    const float depth = glm::dot(d, centre);
    if (!(depth > 0)) return 0;
    const auto inside = [&](const Vec3& axis, float half) {
      const float edge = std::tan(glm::radians(half));
      return 1 - smooth(edge - kSoftEdge, edge + kSoftEdge, std::abs(glm::dot(d, axis)) / depth);
    };
    return radiance * inside(right, halfWidth) * inside(up, halfHeight);
  }
};

constexpr SoftBox kBoxes[] = {{-35, 45, 24, 18, 6}, {100, 25, 13, 25, 1.6f}, {195, 45, 38, 7, 4}};

float radianceOf(const Vec3& d) {
  const float below = 0.22f + 0.1f * smooth(-1, 0, d.y), above = kPaper - 0.25f * smooth(0, 0.9f, d.y);
  float radiance = d.y < 0 ? below + (kPaper - below) * smooth(-0.1f, 0, d.y) : above;
  for (const SoftBox& box : kBoxes) radiance += box.at(d);
  return radiance;
}

}  // namespace

EnvironmentData studioEnvironment(float meanRadiance) {
  const auto image = std::make_shared<Image>();
  image->name = "studio";
  image->width = kWidth;
  image->height = kHeight;
  image->channels = 1;
  double sum = 0, weights = 0;
  for (int y = 0; y < kHeight; ++y) {
    const float theta = kPi * (static_cast<float>(y) + 0.5f) / kHeight;
    for (int x = 0; x < kWidth; ++x) {
      const float phi = 2 * kPi * ((static_cast<float>(x) + 0.5f) / kWidth - 0.5f);
      const Vec3 d(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
      const float radiance = radianceOf(d);
      image->floats.push_back(radiance);
      sum += static_cast<double>(radiance * std::sin(theta));
      weights += static_cast<double>(std::sin(theta));
    }
  }
  const auto scale = static_cast<float>(static_cast<double>(meanRadiance) * weights / sum);
  return {image, Spectrum(scale), 0, kPaper};
}

}  // namespace braid
