// SPDX-License-Identifier: Apache-2.0
// What a film keeps besides means, halves and variances, and what methods and outputs read of it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

namespace braid {

struct KeptBuffers {
  bool features = false;        // albedo, normal, depth, visibility
  bool featureNoise = false;    // their halves and variances, which a film keeps with them
  bool quarters = false;        // of every estimate
  bool history = false;         // variances after rounds 1, 2, 4, …
  bool directIndirect = false;  // direct light by itself, of integrators that separate it
  // Passes, rising, each once: the first of the rounds 1, 2, 4, … with as many keeps its image as well.
  std::vector<uint64_t> stops{};

  static KeptBuffers everything() { return {true, true, true, true, true, {}}; }
  // What either of both holds.
  KeptBuffers& operator|=(const KeptBuffers& other) {
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
  bool operator==(const KeptBuffers&) const = default;
};

}  // namespace braid
