// SPDX-License-Identifier: Apache-2.0
// Photons sorted into a hash grid, to be found by radius. The grid follows the radii: a gather radius grows with the
// distance from the camera, and so do the cells, in octaves. A row of cells along x is contiguous in memory.
//
// Every visited photon's own cell is compared with the cell that is being visited, so that two cells which share a
// bucket never deliver a photon twice. Which photons a query finds, and in which order, does not depend on threads.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// Unit vectors in the octahedral parametrisation (Cigolla et al. 2014, "A Survey of Efficient Representations for
// Independent Unit Vectors"), `bits` for each coordinate.
uint32_t packDirection(const Vec3& d, int bits);
Vec3 unpackDirection(uint32_t packed, int bits);

// A light subpath's arrival at a surface; 32 bytes.
struct Photon {
  Vec3 position{0};
  Spectrum power{0};       // W, divided by |cos| between the direction and the geometric normal
  uint32_t direction = 0;  // back along the path, 2 x 16 bits
  uint16_t normal = 0;     // geometric, on the side of arrival, 2 x 8 bits
  uint16_t segments = 0;   // of the light subpath, at most 65535
};
static_assert(sizeof(Photon) == 32);

// One that left a light and met delta scattering alone, at least once: an eye path can find the same light if it hits
// the lamp by chance. 36 bytes.
struct CausticPhoton : Photon {
  // Of an eye path that goes back along `direction` with density 1 per steradian: how densely it hits the light where
  // the photon started, over the density of photons per m² here and light subpath. 0: no ray can hit the light.
  float hitDensity = 0;
};

// Gather radii over the distance from the camera.
struct RadiusScale {
  Vec3 camera{0};
  bool perspective = true;
  float perMetre = 0;  // radius per metre from the camera; orthographic cameras: the radius everywhere
  float smallest = 1, largest = 1;

  // Of a point that the camera sees over `distance` metres of path.
  float radius(float distance) const {
    const float r = perspective ? perMetre * distance : perMetre;
    return std::min(std::max(r, smallest), largest);
  }
  // Of a point: never so much larger than what the grid expects there that a query would visit cells without end.
  float radiusAt(const Vec3& position, float travelled) const {
    const float r = radius(travelled);
    if (!perspective) return r;
    const float distance = glm::length(position - camera);
    return std::max(std::min({r, 4 * radius(distance), 0.5f * distance}), smallest);
  }
};

template <class PhotonType>
class GridOf {
 public:
  GridOf(std::vector<PhotonType> photons, const RadiusScale& scale);

  size_t size() const { return photons_.size(); }
  const RadiusScale& scale() const { return scale_; }

  // Calls visit(photon, squared distance) for all photons closer to p than `radius`.
  template <class Visit>
  void query(const Vec3& p, float radius, const Visit& visit) const;

  // Bytes that a grid of so many photons needs while it is built, the photons themselves included.
  static uint64_t bytesWhileBuilding(uint64_t photons) {
    return photons * (2 * sizeof(PhotonType) + 2 * sizeof(uint32_t)) + (2 * photons + 1024) * sizeof(uint32_t);
  }

 private:
  struct Cell {
    int level, x, y, z;
  };
  // Octave of the expected radius at a squared distance from the camera.
  int levelOf(float distance2) const {
    const float ratio2 = scale_.perspective ? std::min(distance2 * levelScale2_, largestRatio2_) : largestRatio2_;
    const int exponent = static_cast<int>(std::bit_cast<uint32_t>(ratio2) >> 23) - 127;
    return exponent > 0 ? exponent >> 1 : 0;
  }
  Cell cellOf(const Vec3& p) const {
    const Vec3 d = p - scale_.camera;
    const int level = levelOf(glm::dot(d, d));
    return cellOf(d, level);
  }
  // Relative to the camera: cells near it are small, and so are their numbers.
  Cell cellOf(const Vec3& fromCamera, int level) const {
    const float inverse = inverses_[static_cast<size_t>(level)];
    return {level, toInt(fromCamera.x * inverse), toInt(fromCamera.y * inverse), toInt(fromCamera.z * inverse)};
  }
  static int toInt(float x) { return static_cast<int>(std::floor(std::min(std::max(x, -1e9f), 1e9f))); }
  static uint32_t rowHash(int level, int y, int z) {
    uint32_t h = static_cast<uint32_t>(y) * 0x9e3779b1u ^ static_cast<uint32_t>(z) * 0x85ebca77u ^
                 static_cast<uint32_t>(level) * 0xc2b2ae3du;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    return h ^ (h >> 13);
  }
  uint32_t bucketOf(const Cell& c) const { return (static_cast<uint32_t>(c.x) + rowHash(c.level, c.y, c.z)) & mask_; }
  template <class Visit>
  void visitRow(const Vec3& p, float radius2, const Cell& from, int toX, const Visit& visit) const;

  RadiusScale scale_;
  float levelScale2_ = 0, largestRatio2_ = 1;
  std::vector<float> inverses_;  // 1 / cell size, per level
  uint32_t mask_ = 0;
  std::vector<uint32_t> start_;  // of each bucket, and the end of the last
  std::vector<PhotonType> photons_;
};

using PhotonGrid = GridOf<Photon>;
using CausticGrid = GridOf<CausticPhoton>;

template <class PhotonType>
template <class Visit>
void GridOf<PhotonType>::visitRow(const Vec3& p, float radius2, const Cell& from, int toX, const Visit& visit) const {
  uint32_t bucket = bucketOf(from);
  auto left = static_cast<uint32_t>(toX - from.x) + 1;
  while (left > 0) {
    const uint32_t count = std::min(left, mask_ + 1 - bucket);
    for (uint32_t i = start_[bucket], end = start_[bucket + count]; i < end; ++i) {
      const PhotonType& photon = photons_[i];
      const Vec3 d = photon.position - p;
      const float distance2 = glm::dot(d, d);
      if (!(distance2 < radius2)) continue;
      const Cell cell = cellOf(photon.position);
      if (cell.level == from.level && cell.y == from.y && cell.z == from.z) visit(photon, distance2);
    }
    left -= count;
    bucket = 0;
  }
}

template <class PhotonType>
template <class Visit>
void GridOf<PhotonType>::query(const Vec3& p, float radius, const Visit& visit) const {
  if (photons_.empty()) return;
  const Vec3 centre = p - scale_.camera;
  const float distance = glm::length(centre), margin = radius * (1 + 1e-5f) + distance * 1e-6f;
  const int first = levelOf(sqr(std::max(distance - margin, 0.0f))), last = levelOf(sqr(distance + margin));
  for (int level = first; level <= last; ++level) {
    const Cell lo = cellOf(centre - radius, level), hi = cellOf(centre + radius, level);
    for (int z = lo.z; z <= hi.z; ++z)
      for (int y = lo.y; y <= hi.y; ++y) visitRow(p, sqr(radius), {level, lo.x, y, z}, hi.x, visit);
  }
}

}  // namespace braid
