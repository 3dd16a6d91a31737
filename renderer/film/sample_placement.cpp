// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/sample_placement.h"

#include <algorithm>

namespace braid {

SamplePlacement::SamplePlacement(int windowWidth, int windowHeight) : width(windowWidth), height(windowHeight) {
  const int columns = (width + kTile - 1) / kTile, rows = (height + kTile - 1) / kTile;
  count.fill(Plane<double>(columns, rows));
  hits.fill(Plane<double>(columns, rows));
  weight.fill(Plane<double>(columns, rows, 1.0));
}

int SamplePlacement::pixels(size_t tile) const {
  const int x = static_cast<int>(tile) % columns() * kTile, y = static_cast<int>(tile) / columns() * kTile;
  return std::min(kTile, width - x) * std::min(kTile, height - y);
}

bool SamplePlacement::even() const {
  return std::all_of(count.begin(), count.end(), [](const Plane<double>& c) {
    return std::all_of(c.data.begin(), c.data.end(), [&](double n) { return n == c[0]; });
  });
}

std::pair<uint64_t, uint64_t> SamplePlacement::range() const {
  uint64_t fewest = ~uint64_t(0), most = 0;
  for (size_t t = 0; t < tiles(); ++t) {
    const auto n = static_cast<uint64_t>(total(t));
    fewest = std::min(fewest, n);
    most = std::max(most, n);
  }
  return {std::min(fewest, most), most};
}

Plane<float> SamplePlacement::samples() const {
  Plane<float> out(width, height, kUnfilled);
  forEachPlacedPixel(*this, [&](size_t i, size_t tile) { out[i] = static_cast<float>(total(tile)); });
  return out;
}

void SamplePlacement::listSums(RawSums& list) {
  for (size_t k = 0; k < count.size(); ++k) list.push_back({"placement.count" + std::to_string(k), &count[k], kTile});
  for (size_t h = 0; h < hits.size(); ++h)
    list.push_back({std::string("placement.hits") + (h == 0 ? 'A' : 'B'), &hits[h], kTile});
}

void SamplePlacement::listMap(RawSums& list) {
  for (size_t h = 0; h < weight.size(); ++h)
    list.push_back({std::string("placement.weight") + (h == 0 ? 'A' : 'B'), &weight[h], kTile});
}

}  // namespace braid
