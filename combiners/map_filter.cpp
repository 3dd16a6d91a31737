// SPDX-License-Identifier: Apache-2.0
#include "combiners/map_filter.h"

#include <utility>

#include "combiners/finite_float.h"
#include "combiners/sure_map.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

template <class Body>
void forAllValues(Rgb<float>& map, const Body& body) {
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(map.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) body(map[c][i], c, i);
    });
}

}  // namespace

MapFilter::MapFilter(double sigma, const Rgb<float>* level) : sigma_(sigma) {
  if (!level) return;
  for (Plane<float>& plane : unit_) plane = Plane<float>(level->width(), level->height(), kUnfilled);
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(level->size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) unit_[c][i] = finiteFloat(sqr(static_cast<double>((*level)[c][i])) + 0.01);
    });
}

Rgb<float> MapFilter::toUnits(Rgb<float> map) const {
  if (!unit_[0].empty()) forAllValues(map, [&](float& value, size_t c, size_t i) { value /= unit_[c][i]; });
  return map;
}

Rgb<float> MapFilter::fromUnits(Rgb<float> map) const {
  if (!unit_[0].empty()) forAllValues(map, [&](float& value, size_t c, size_t i) { value *= unit_[c][i]; });
  return map;
}

Rgb<float> MapFilter::operator()(const Rgb<float>& map) const {
  return fromUnits(gaussianFiltered(toUnits(map), sigma_));
}

Rgb<float> MapFilter::risk(Rgb<float> sure, const Rgb<float>& variance) const {
  const Rgb<float> unfiltered = toUnits(std::move(sure));
  Rgb<float> filtered = gaussianFiltered(unfiltered, sigma_);
  applySignRule(filtered, unfiltered, toUnits(variance));
  return fromUnits(std::move(filtered));
}

}  // namespace braid
