// SPDX-License-Identifier: Apache-2.0
// The environment: a latitude-longitude image or a constant, looked up by direction and importance-sampled by radiance,
// for a surface also by its cosine (environment_blocks.h).
#pragma once

#include <memory>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/data/scene_data.h"
#include "renderer/scene/environment_blocks.h"

namespace braid {

class Environment {
 public:
  explicit Environment(const EnvironmentData& data);

  // Radiance arriving from the world direction (unit, pointing away from the scene).
  Spectrum radiance(const Vec3& direction) const;
  // Picks a direction, with what arrives from it, for a surface of this normal (unit; zero: for any); returns its
  // density per solid angle, 0 if the environment is black.
  float sample(const Vec3& normal, Vec2 u, Vec3& direction, Spectrum& radiance) const;
  float pdfW(const Vec3& normal, const Vec3& direction) const;

  bool constant() const { return image_ == nullptr; }
  // Mean radiance over the sphere.
  Spectrum average() const { return average_; }
  size_t bytes() const { return (conditional_.size() + marginal_.size()) * sizeof(float) + blocks_.bytes(); }

 private:
  Vec3 toLocal(const Vec3& direction) const;
  Vec3 toWorld(const Vec3& direction) const;
  Spectrum texel(int x, int y) const;
  Spectrum radianceAt(float column, float row) const;
  float pdfOfTexel(size_t x, size_t y) const;
  TexelDistribution texels() const { return {conditional_, marginal_, width_, height_}; }
  void buildDistribution();

  std::shared_ptr<const Image> image_;
  Spectrum scale_{0};
  float base_ = 0;
  Spectrum average_{0};
  float cosRotation_ = 1, sinRotation_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<float> conditional_;  // per row: width + 1 cumulative values, normalised
  std::vector<float> marginal_;     // height + 1 cumulative values, normalised
  EnvironmentBlocks blocks_;
};

}  // namespace braid
