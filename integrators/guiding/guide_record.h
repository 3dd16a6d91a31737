// SPDX-License-Identifier: Apache-2.0
// What training paths tell: at every vertex that they went on from, how they were sampled there and what they found.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "integrators/guiding/guided_bsdf.h"
#include "renderer/scene/accel.h"

namespace braid {

struct GuideRecord {
  Vec3 position;
  float pdfW, bsdfPdfW, guidePdfW;
  float value;  // what the direction brought to the pixel: throughput · light / pdfW, mean of the channels
  uint32_t pixel : 27;
  uint32_t guided : 1;   // guidePdfW is that of a guide
  uint32_t surface : 4;  // guideClass()
};

// Writes down the paths of a batch. Vertices from which nothing was found are dropped: they tell no direction.
class PathRecorder {
 public:
  static constexpr size_t kMostVertices = 6;  // of a path; later ones are not recorded

  void begin() { vertices_.fill(Vertices{}); }
  // Path i scatters at a surface, by no delta lobe.
  void leave(int i, const Hit& hit, const GuidedBsdf& bsdf, const GuidedSample& sample);
  // Path i has arrived at what its ray met, and found `radiance` until now.
  void arrive(int i, const Spectrum& radiance) {
    Vertices& path = vertices_[static_cast<size_t>(i)];
    if (!path.travels) return;
    path.travels = false;
    path.before[path.count - 1] = average(radiance);
  }
  // Path i of a pixel has ended; its records are appended to `out`.
  void finish(int i, const Spectrum& radiance, uint32_t pixel, std::vector<GuideRecord>& out) const;

 private:
  struct Vertices {
    size_t count = 0;
    bool travels = false;
    std::array<GuideRecord, kMostVertices> record;
    std::array<float, kMostVertices> before;  // found up to the vertex, its own light sample included
  };
  std::array<Vertices, kBatch> vertices_;
};

// Light that arrives at a surface, by a subpath from a light.
struct GuidePhoton {
  Vec3 position;
  Vec2 place;  // the direction that it comes from, on the square of its class
  float power;
  uint32_t surface;  // guideClass()
};

// Bounds of the shares; a guide that goes on learning must not be given up.
struct ShareRange {
  float least = 0, most = 0.9f;
};

// Learns densities from photons, and their shares from records. `scale` has a factor for each pixel that makes its
// values relative to its brightness.
Guide learnGuide(std::vector<GuidePhoton> photons, std::span<const GuideRecord> records, std::span<const float> scale,
                 const ShareRange& shares = {});

}  // namespace braid
