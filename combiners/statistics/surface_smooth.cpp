// SPDX-License-Identifier: Apache-2.0
#include "combiners/statistics/surface_smooth.h"

#include <algorithm>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/packed_rows.h"
#include "combiners/pixels/simd.h"

namespace braid {

namespace {

constexpr float kAlbedoScale = -1 / (2 * 0.25f * 0.25f), kNormalScale = -1 / (2 * 0.15f * 0.15f);
constexpr int kFeatures = 6;

static_assert(kLanes <= PackedRows::kSlack);

std::vector<Plane<float>> boxMeans(const std::vector<const Plane<float>*>& planes, int radius) {
  std::vector<Plane<float>> out;
  for (const Plane<float>* p : planes) {
    const Plane<double> mean = boxMean(*p, radius);
    out.emplace_back(p->width, p->height);
    for (size_t i = 0; i < mean.size(); ++i) out.back()[i] = finiteFloat(mean[i]);
  }
  return out;
}

// Adds the neighbours at (dx, other - y) to the sums of one row: kFeatures guide planes come first in `in`, and the sum
// of the weights last in `sums`, whose rows are as far apart as those of `in`.
void addNeighbours(const PackedRows& in, int width, int y, int other, int dx, float* sums) {
  const int begin = std::max(0, -dx), end = std::min(width, width - dx);
  const float *centre = in.row(0, y), *neighbour = in.row(0, other) + dx;
  const size_t pitch = in.pitch();
  const auto values = static_cast<size_t>(in.planes() - kFeatures);
  for (int x = begin; x < end; x += kLanes) {
    FloatLanes distance[2] = {};
    for (size_t k = 0; k < kFeatures; ++k) {
      const FloatLanes d = loadLanes(centre + k * pitch + x) - loadLanes(neighbour + k * pitch + x);
      distance[k / 3] += d * d;
    }
    FloatLanes w = expNegative(distance[0] * kAlbedoScale + distance[1] * kNormalScale);
    if (end - x < kLanes) w = laneIndices() < static_cast<float>(end - x) ? w : FloatLanes{};
    for (size_t k = 0; k < values; ++k) {
      float* sum = sums + k * pitch + x;
      storeLanes(sum, loadLanes(sum) + w * loadLanes(neighbour + (kFeatures + k) * pitch + x));
    }
    storeLanes(sums + values * pitch + x, loadLanes(sums + values * pitch + x) + w);
  }
}

}  // namespace

std::vector<Plane<float>> surfaceSmooth(const std::vector<const Plane<float>*>& planes, const Features* features,
                                        int radius) {
  if (!features || features->albedo.mean.empty() || features->normal.mean.empty()) return boxMeans(planes, radius);
  const int width = planes[0]->width, height = planes[0]->height;
  std::vector<const Plane<float>*> all;
  for (const Rgb<float>* guide : {&features->albedo.mean, &features->normal.mean})
    for (size_t c = 0; c < 3; ++c) all.push_back(&(*guide)[c]);
  all.insert(all.end(), planes.begin(), planes.end());
  const PackedRows in(all);
  std::vector<Plane<float>> out(planes.size(), Plane<float>(width, height));
  parallelRows(height, [&](int y) {
    const size_t pitch = in.pitch();
    std::vector<float> sums((planes.size() + 1) * pitch, 0.0f);
    for (int other = std::max(0, y - radius); other <= std::min(height - 1, y + radius); ++other)
      for (int dx = -radius; dx <= radius; ++dx) addNeighbours(in, width, y, other, dx, sums.data());
    const float* weights = sums.data() + planes.size() * pitch;
    for (size_t k = 0; k < planes.size(); ++k)
      for (int x = 0; x < width; ++x)
        out[k].at(x, y) = finiteFloat(static_cast<double>(sums[k * pitch + static_cast<size_t>(x)] / weights[x]));
  });
  return out;
}

}  // namespace braid
