// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/environment.h"

#include <algorithm>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/core/image_values.h"

namespace braid {

namespace {

// Of radiance that is left to surfaces: nothing may be impossible, as photons come from here as well.
constexpr float kRest = 0.05f;

// The cumulative table of row y, width + 1 values from 0 to 1, and the mean density of its texels. That of a texel is
// the mean of the bilinear interpolant over it (weights 1/8, 3/4, 1/8 on each axis), so that it is positive wherever
// the interpolated radiance is.
double accumulateRow(const Plane<float>& radiance, int y, float* cdf) {
  const int width = radiance.width, height = radiance.height;
  const size_t w = static_cast<size_t>(width);
  std::vector<double> sum(w + 1, 0.0);
  for (int x = 0; x < width; ++x) {
    double v = 0;
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        v += (dx ? 0.125 : 0.75) * (dy ? 0.125 : 0.75) *
             static_cast<double>(radiance.at((x + dx + width) % width, std::clamp(y + dy, 0, height - 1)));
    sum[static_cast<size_t>(x) + 1] = sum[static_cast<size_t>(x)] + v;
  }
  for (size_t x = 0; x <= w; ++x)
    cdf[x] = static_cast<float>(sum[w] > 0 ? sum[x] / sum[w] : static_cast<double>(x) / static_cast<double>(w));
  return sum[w] / static_cast<double>(w);
}

}  // namespace

Environment::Environment(const EnvironmentData& data) : image_(data.image), scale_(data.radiance), base_(data.base) {
  cosRotation_ = std::cos(data.rotation);
  sinRotation_ = std::sin(data.rotation);
  if (!image_) {
    average_ = scale_;
    return;
  }
  width_ = image_->width;
  height_ = image_->height;
  buildDistribution();
}

// The angle φ grows to the right of the image, from +X in its centre (φ = 0) toward +Z; its upper edge is +Y.
Vec3 Environment::toLocal(const Vec3& d) const {
  return {cosRotation_ * d.x - sinRotation_ * d.z, d.y, sinRotation_ * d.x + cosRotation_ * d.z};
}
Vec3 Environment::toWorld(const Vec3& d) const {
  return {cosRotation_ * d.x + sinRotation_ * d.z, d.y, -sinRotation_ * d.x + cosRotation_ * d.z};
}

Spectrum Environment::texel(int x, int y) const {
  const size_t channels = static_cast<size_t>(image_->channels);
  const size_t i = (static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)) * channels;
  if (!image_->floats.empty()) {
    const float* p = &image_->floats[i];
    return channels >= 3 ? Spectrum(p[0], p[1], p[2]) : Spectrum(p[0]);
  }
  const uint8_t* p = &image_->bytes[i];
  const auto decode = [](uint8_t b) { return decodeSrgb(static_cast<float>(b) / 255.0f); };
  return channels >= 3 ? Spectrum(decode(p[0]), decode(p[1]), decode(p[2])) : Spectrum(decode(p[0]));
}

// Even light is found best by the surface that it falls on, bright spots by light sampling: without the even part of
// the image (MIS compensation, Karlík et al. 2019) less light samples are spent on it.
void Environment::buildDistribution() {
  const size_t w = static_cast<size_t>(width_), h = static_cast<size_t>(height_);
  Plane<float> luminances(width_, height_);
  std::vector<glm::dvec3> rowSum(h);
  parallelRows(height_, [&](int y) {
    glm::dvec3 sum(0);
    for (int x = 0; x < width_; ++x) {
      const Spectrum s = texel(x, y);
      sum += glm::dvec3(s);
      const float radiance = braid::average(s);
      luminances.at(x, y) = base_ > 0 ? std::max(radiance - base_, 0.0f) + kRest * radiance : radiance;
    }
    rowSum[static_cast<size_t>(y)] = sum / static_cast<double>(width_);
  });
  conditional_.resize((w + 1) * h);
  marginal_.resize(h + 1);
  std::vector<double> rowWeight(h);
  parallelRows(height_, [&](int y) {
    const float sinTheta = std::sin(kPi * (static_cast<float>(y) + 0.5f) / static_cast<float>(height_));
    float* cdf = &conditional_[static_cast<size_t>(y) * (w + 1)];
    rowWeight[static_cast<size_t>(y)] = accumulateRow(luminances, y, cdf) * static_cast<double>(sinTheta);
  });
  double total = 0, sinTotal = 0;
  glm::dvec3 mean(0);
  std::vector<double> cumulative(h + 1, 0.0);
  for (size_t y = 0; y < h; ++y) {
    const double sinTheta =
        std::sin(static_cast<double>(kPi) * (static_cast<double>(y) + 0.5) / static_cast<double>(h));
    total += rowWeight[y];
    cumulative[y + 1] = total;
    mean += rowSum[y] * sinTheta;
    sinTotal += sinTheta;
  }
  for (size_t y = 0; y <= h; ++y)
    marginal_[y] = static_cast<float>(total > 0 ? cumulative[y] / total : double(y) / double(h));
  average_ = total > 0 ? scale_ * Spectrum(mean / sinTotal) : Spectrum(0);
  if (total > 0) blocks_.build(texels());
}

Spectrum Environment::radiance(const Vec3& direction) const {
  if (!image_) return scale_;
  const Vec3 d = toLocal(direction);
  const float phi = std::atan2(d.z, d.x);
  const float theta = std::acos(std::clamp(d.y, -1.0f, 1.0f));
  return radianceAt((0.5f + phi * 0.5f * kInvPi) * static_cast<float>(width_),
                    theta * kInvPi * static_cast<float>(height_));
}

// Bilinear, at a position in the image in texels from its upper left corner.
Spectrum Environment::radianceAt(float column, float row) const {
  const float x = column - 0.5f, y = row - 0.5f;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const auto at = [&](int i, int j) { return texel((i % width_ + width_) % width_, std::clamp(j, 0, height_ - 1)); };
  const Spectrum top = at(x0, y0) * (1 - fx) + at(x0 + 1, y0) * fx;
  const Spectrum bottom = at(x0, y0 + 1) * (1 - fx) + at(x0 + 1, y0 + 1) * fx;
  return scale_ * (top * (1 - fy) + bottom * fy);
}

float Environment::sample(const Vec3& normal, Vec2 u, Vec3& direction, Spectrum& radiance) const {
  if (isBlack(average_)) return 0;
  if (!image_) {
    const float z = 1 - 2 * u.x, r = safeSqrt(1 - z * z), phi = 2 * kPi * u.y;
    direction = {r * std::cos(phi), z, r * std::sin(phi)};
    radiance = scale_;
    return 0.25f * kInvPi;
  }
  Vec2 at;
  float ratio = 1;
  if (isBlack(normal)) {
    const int y = findStep([&](int k) { return marginal_[static_cast<size_t>(k)]; }, height_, u.y);
    const float* row = &conditional_[static_cast<size_t>(y) * (static_cast<size_t>(width_) + 1)];
    const int x = findStep([&](int k) { return row[k]; }, width_, u.x);
    at = Vec2(withinTexel(static_cast<size_t>(x), u.x), withinTexel(static_cast<size_t>(y), u.y));
  } else {
    ratio = blocks_.sample(texels(), toLocal(normal), u, at);
    if (!(ratio > 0)) return 0;
  }
  const float theta = kPi * at.y / static_cast<float>(height_);
  const float phi = 2 * kPi * (at.x / static_cast<float>(width_) - 0.5f);
  const float sinTheta = std::sin(theta);
  direction = toWorld({sinTheta * std::cos(phi), std::cos(theta), sinTheta * std::sin(phi)});
  radiance = radianceAt(at.x, at.y);
  if (!(sinTheta > 0)) return 0;
  return ratio * pdfOfTexel(static_cast<size_t>(at.x), static_cast<size_t>(at.y)) / sinTheta;
}

// Density per solid angle, times the sine of the polar angle.
float Environment::pdfOfTexel(size_t x, size_t y) const {
  const float* cdf = &conditional_[y * (static_cast<size_t>(width_) + 1)];
  const float px = cdf[x + 1] - cdf[x], py = marginal_[y + 1] - marginal_[y];
  return px * py * static_cast<float>(width_) * static_cast<float>(height_) / (2 * kPi * kPi);
}

float Environment::pdfW(const Vec3& normal, const Vec3& direction) const {
  if (isBlack(average_)) return 0;
  if (!image_) return 0.25f * kInvPi;
  const Vec3 d = toLocal(direction);
  const float phi = std::atan2(d.z, d.x);
  const float theta = std::acos(std::clamp(d.y, -1.0f, 1.0f));
  const float sinTheta = safeSqrt(1 - d.y * d.y);
  if (!(sinTheta > 0)) return 0;
  const int x = std::clamp(static_cast<int>((0.5f + phi * 0.5f * kInvPi) * static_cast<float>(width_)), 0, width_ - 1);
  const int y = std::clamp(static_cast<int>(theta * kInvPi * static_cast<float>(height_)), 0, height_ - 1);
  const float pdf = pdfOfTexel(static_cast<size_t>(x), static_cast<size_t>(y)) / sinTheta;
  return isBlack(normal) ? pdf : pdf * blocks_.ratio(toLocal(normal), x, y);
}

}  // namespace braid
