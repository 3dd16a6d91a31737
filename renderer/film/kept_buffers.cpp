// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/kept_buffers.h"

#include <algorithm>
#include <iterator>

namespace braid {

KeptBuffers& KeptBuffers::operator|=(const KeptBuffers& other) {
  features |= other.features;
  featureNoise |= other.featureNoise;
  quarters |= other.quarters;
  history |= other.history;
  directIndirect |= other.directIndirect;
  std::vector<uint64_t> both;
  std::set_union(stops.begin(), stops.end(), other.stops.begin(), other.stops.end(), std::back_inserter(both));
  stops = std::move(both);
  return *this;
}

}  // namespace braid
