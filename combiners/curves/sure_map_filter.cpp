// SPDX-License-Identifier: Apache-2.0
#include "combiners/curves/sure_map_filter.h"

#include <algorithm>
#include <utility>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/sure_map.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kWideRadius = 20;
constexpr double kScatters = 3;

template <class Body>
void forAllValues(Rgb<float>& map, const Body& body) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(map.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) body(map[c][i], c, i);
    });
}

}  // namespace

SureMapFilter::SureMapFilter(double sigma, const Rgb<float>* level, bool pooled) : sigma_(sigma), pooled_(pooled) {
  if (!level) return;
  for (Plane<float>& plane : unit_) plane = Plane<float>(level->width(), level->height(), kUnfilled);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(level->size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) unit_[c][i] = finiteFloat(sqr(static_cast<double>((*level)[c][i])) + 0.01);
    });
}

Rgb<float> SureMapFilter::toUnits(Rgb<float> map) const {
  if (!unit_[0].empty()) forAllValues(map, [&](float& value, size_t c, size_t i) { value /= unit_[c][i]; });
  return map;
}

Rgb<float> SureMapFilter::fromUnits(Rgb<float> map) const {
  if (!unit_[0].empty()) forAllValues(map, [&](float& value, size_t c, size_t i) { value *= unit_[c][i]; });
  return map;
}

Rgb<float> SureMapFilter::operator()(const Rgb<float>& map) const {
  return fromUnits(gaussianFiltered(toUnits(map), sigma_));
}

Plane<float> SureMapFilter::pooledRisk(const Plane<float>& sure, const Plane<float>& variance) const {
  Plane<float> wide = boxMean<float>(sure, kWideRadius);
  {
    const Plane<float> wideVariance = boxMean<float>(variance, kWideRadius), near = gaussianFiltered(variance, sigma_);
    parallelChunks(wide.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        wide[i] = wideVariance[i] > 0 ? near[i] * std::max(0.0f, wide[i] / wideVariance[i]) : 0;
    });
  }
  Plane<float> square = sure;
  for (float& value : square.data) value *= value;
  square = gaussianFiltered(square, sigma_);
  Plane<float> out = gaussianFiltered(sure, sigma_);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double start = static_cast<double>(wide[i]), mean = static_cast<double>(out[i]), difference = mean - start;
      const double scatter = std::max(0.0, static_cast<double>(square[i]) - mean * mean) / kMapWindowPixels;
      const double kept = std::max(0.0, difference * difference - kScatters * scatter);
      out[i] = kept > 0 ? finiteFloat(std::max(0.0, start + kept / difference)) : wide[i];
    }
  });
  return out;
}

Rgb<float> SureMapFilter::risk(Rgb<float> sure, const Rgb<float>& variance) const {
  const Rgb<float> unfiltered = toUnits(std::move(sure));
  if (pooled_) {
    Rgb<float> risks = toUnits(variance);
    for (size_t c = 0; c < 3; ++c) risks[c] = pooledRisk(unfiltered[c], risks[c]);
    return fromUnits(std::move(risks));
  }
  Rgb<float> filtered = gaussianFiltered(unfiltered, sigma_);
  applySignRule(filtered, unfiltered, toUnits(variance));
  return fromUnits(std::move(filtered));
}

}  // namespace braid
