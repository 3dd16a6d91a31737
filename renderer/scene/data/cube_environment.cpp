// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/cube_environment.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"
#include "renderer/core/image_values.h"

namespace braid {

namespace {

constexpr int kWidestEnvironment = 4096;
constexpr int kIrradianceWidth = 128;
constexpr int kMostProbes = 4;    // of a pixel, on each axis
constexpr int kMostOfEdge = 256;  // places at which an edge is compared

const std::array<float, 256>& srgbTable() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (size_t i = 0; i < t.size(); ++i) t[i] = decodeSrgb(static_cast<float>(i) / 255.0f);
    return t;
  }();
  return table;
}

// OpenGL's choice of a face for a direction, and where on it: s to the right, t down, from -1 to 1.
struct OnFace {
  size_t face = 0;
  float s = 0, t = 0;
};

OnFace onFace(const Vec3& d) {
  const Vec3 a = glm::abs(d);
  if (a.x >= a.y && a.x >= a.z) return {d.x < 0 ? 1u : 0u, (d.x < 0 ? d.z : -d.z) / a.x, -d.y / a.x};
  if (a.y >= a.z) return {d.y < 0 ? 3u : 2u, d.x / a.y, (d.y < 0 ? -d.z : d.z) / a.y};
  return {d.z < 0 ? 5u : 4u, (d.z < 0 ? -d.x : d.x) / a.z, -d.y / a.z};
}

// Its inverse, also for places beyond the edges.
Vec3 directionOf(const OnFace& at) {
  switch (at.face) {
    case 0:
      return {1, -at.t, -at.s};
    case 1:
      return {-1, -at.t, at.s};
    case 2:
      return {at.s, 1, at.t};
    case 3:
      return {at.s, -1, -at.t};
    case 4:
      return {at.s, -at.t, 1};
    default:
      return {-at.s, -at.t, -1};
  }
}

class CubeMap {
 public:
  CubeMap(const CubeFaces& faces, CubeLayout layout)
      : faces_(faces),
        size_(faces[0]->width),
        turnS_(layout == CubeLayout::Mirrored ? -1.0f : 1.0f),
        turnT_(layout == CubeLayout::UpsideDown ? -1.0f : 1.0f) {}

  int size() const { return size_; }

  // In the axes of OpenGL's cube; bilinear within a face.
  Spectrum at(const Vec3& direction) const {
    const OnFace on = onFace(direction);
    const float n = static_cast<float>(size_);
    const float x = (turnS_ * on.s + 1) * 0.5f * n - 0.5f, y = (turnT_ * on.t + 1) * 0.5f * n - 0.5f;
    const float x0 = std::floor(x), y0 = std::floor(y), fx = x - x0, fy = y - y0;
    const int i = static_cast<int>(x0), j = static_cast<int>(y0);
    const auto pixel = [&](int dx, int dy) { return texel(*faces_[on.face], i + dx, j + dy); };
    const Spectrum top = pixel(0, 0) * (1 - fx) + pixel(1, 0) * fx;
    return top * (1 - fy) + (pixel(0, 1) * (1 - fx) + pixel(1, 1) * fx) * fy;
  }

 private:
  Spectrum texel(const Image& face, int x, int y) const {
    const auto column = static_cast<size_t>(std::clamp(x, 0, size_ - 1));
    const auto row = static_cast<size_t>(std::clamp(y, 0, size_ - 1));
    const auto channels = static_cast<size_t>(face.channels);
    const size_t i = (row * static_cast<size_t>(size_) + column) * channels;
    Spectrum colour;
    float alpha = 1, least = 1;
    for (size_t c = 0; c < 3; ++c) {
      const size_t k = i + (channels >= 3 ? c : 0);
      colour[static_cast<int>(c)] = face.floats.empty()  ? srgbTable()[face.bytes[k]]
                                    : face.integerFloats ? decodeSrgb(face.floats[k])
                                                         : face.floats[k];
    }
    if (!face.hasAlpha()) return colour;
    const size_t last = i + channels - 1;
    if (face.floats.empty()) {
      alpha = static_cast<float>(face.bytes[last]) / 255.0f;
      least = 1 / 255.0f;
    } else if (face.integerFloats) {
      alpha = face.floats[last];
      least = 1 / 65535.0f;
    }
    return colour / std::max(alpha, least);
  }

  const CubeFaces& faces_;
  int size_;
  float turnS_, turnT_;
};

// How little the faces meet: |a - b| / (a + b) of pixels on both sides of all edges, summed.
double seams(const CubeMap& cube) {
  const int places = std::min(cube.size(), kMostOfEdge);
  const float inside = 1 - 1 / static_cast<float>(cube.size()), outside = 2 - inside;
  double sum = 0;
  for (size_t face = 0; face < 6; ++face)
    for (int edge = 0; edge < 4; ++edge)
      for (int k = 0; k < places; ++k) {
        const float along = 2 * (static_cast<float>(k) + 0.5f) / static_cast<float>(places) - 1;
        const auto radiance = [&](float across) {
          const float place = edge < 2 ? across : -across;
          return static_cast<double>(
              average(cube.at(directionOf(edge % 2 == 0 ? OnFace{face, place, along} : OnFace{face, along, place}))));
        };
        const double a = radiance(inside), b = radiance(outside);
        if (a + b > 0) sum += std::abs(a - b) / (a + b);
      }
  return sum;
}

template <class Radiance>
std::shared_ptr<const Image> latitudeLongitude(int width, int probes, const Radiance& radiance) {
  const auto image = std::make_shared<Image>();
  image->width = width;
  image->height = width / 2;
  image->channels = 3;
  image->floats.resize(static_cast<size_t>(width) * static_cast<size_t>(image->height) * 3);
  parallelRows(image->height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      glm::dvec3 sum(0);
      double weights = 0;
      for (int j = 0; j < probes; ++j) {
        const double down = y + (j + 0.5) / probes;
        const double theta = glm::pi<double>() * down / image->height, weight = std::sin(theta);
        for (int i = 0; i < probes; ++i) {
          const double phi = 2 * glm::pi<double>() * ((x + (i + 0.5) / probes) / width - 0.5);
          sum += weight * radiance({std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)});
          weights += weight;
        }
      }
      const size_t at = (static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)) * 3;
      for (int c = 0; c < 3; ++c) image->floats[at + static_cast<size_t>(c)] = static_cast<float>(sum[c] / weights);
    }
  });
  return image;
}

}  // namespace

CubeLayout layoutOf(const CubeFaces& faces) {
  constexpr double kFarBetter = 0.5;
  CubeLayout best = CubeLayout::Mirrored;
  double least = kFarBetter * seams(CubeMap(faces, best));
  for (const CubeLayout layout : {CubeLayout::UpsideDown, CubeLayout::OpenGl}) {
    const double error = seams(CubeMap(faces, layout));
    if (!(error < least)) continue;
    least = error;
    best = layout;
  }
  return best;
}

std::shared_ptr<const Image> cubeEnvironment(const CubeFaces& faces, CubeLayout layout, const glm::dmat3& rotation) {
  const CubeMap cube(faces, layout);
  const int width = std::clamp(4 * std::min(cube.size(), kWidestEnvironment), 16, kWidestEnvironment);
  const int probes = std::clamp((4 * cube.size() + width - 1) / width + 1, 2, kMostProbes);
  const glm::dmat3 toCube = glm::transpose(rotation);
  const double side = layout == CubeLayout::Mirrored ? 1 : -1;
  return latitudeLongitude(width, probes, [&](const glm::dvec3& world) {
    const glm::dvec3 d = toCube * world;
    return glm::dvec3(cube.at(Vec3(side * d.x, d.y, d.z)));
  });
}

std::shared_ptr<const Image> irradianceEnvironment(const IrradianceCoefficients& irradiance,
                                                   const glm::dmat3& rotation) {
  // Irradiance has the bands of radiance times π, 2π/3, π/4.
  constexpr double kPerBand[] = {1, 2.0 / 3, 0.25};
  std::array<glm::dvec3, 9> radiance;
  for (size_t k = 0; k < 9; ++k)
    radiance[k] = glm::dvec3(irradiance[k]) / (glm::pi<double>() * kPerBand[k == 0 ? 0 : k < 4 ? 1 : 2]);
  const glm::dmat3 toLight = glm::transpose(rotation);
  return latitudeLongitude(kIrradianceWidth, 2, [&](const glm::dvec3& world) {
    const glm::dvec3 d = toLight * world;
    const double basis[9] = {0.28209479177387814,
                             0.4886025119029199 * d.y,
                             0.4886025119029199 * d.z,
                             0.4886025119029199 * d.x,
                             1.0925484305920792 * d.x * d.y,
                             1.0925484305920792 * d.y * d.z,
                             0.31539156525252005 * (3 * d.z * d.z - 1),
                             1.0925484305920792 * d.x * d.z,
                             0.5462742152960396 * (d.x * d.x - d.y * d.y)};
    glm::dvec3 sum(0);
    for (size_t k = 0; k < 9; ++k) sum += basis[k] * radiance[k];
    return glm::max(sum, glm::dvec3(0));
  });
}

}  // namespace braid
