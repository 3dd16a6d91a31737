// SPDX-License-Identifier: Apache-2.0
// Sobol' points with hash-based Owen scrambling (Laine and Karras 2011, Burley 2020, with the hash constants found by
// Vegdahl 2021), and a counter-based independent generator. Direction numbers: Joe and Kuo 2008, from Boost.Random's
// table.
#include "renderer/core/sampler.h"

#include <boost/random/sobol.hpp>

namespace braid {

namespace {

constexpr uint32_t reverseBits(uint32_t x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

float toUnit(uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24f; }

using Directions = std::array<uint32_t, 32>;

// The direction numbers of one Sobol' coordinate. The initial numbers m are extended by the recurrence of the
// dimension's primitive polynomial (Joe and Kuo 2008, Eq. 2).
Directions directionsOf(unsigned d) {
  using Table = boost::random::default_sobol_table;
  Directions v{};
  if (d == 0) {
    for (unsigned k = 0; k < 32; ++k) v[k] = 1u << (31 - k);
    return v;
  }
  const auto polynomial = static_cast<uint32_t>(Table::polynomial(d - 1));
  unsigned degree = 31;
  while (!(polynomial >> degree)) --degree;
  for (unsigned k = 0; k < degree; ++k) v[k] = static_cast<uint32_t>(Table::minit(d - 1, k)) << (31 - k);
  for (unsigned k = degree; k < 32; ++k) {
    v[k] = v[k - degree] ^ (v[k - degree] >> degree);
    for (unsigned j = 1; j < degree; ++j)
      if ((polynomial >> (degree - j)) & 1u) v[k] ^= v[k - j];
  }
  return v;
}

// One Sobol' coordinate: dimension d, point i. The first dimensions' numbers are kept: passes that render some tiles
// only make a table for few pixels.
uint32_t sobolCoordinate(unsigned d, uint32_t i) {
  static const std::vector<Directions> kept = [] {
    std::vector<Directions> list;
    for (unsigned k = 0; k < 24 * kBlockSize; ++k) list.push_back(directionsOf(k));
    return list;
  }();
  const Directions v = d < kept.size() ? kept[d] : directionsOf(d);
  uint32_t x = 0;
  for (unsigned k = 0; i != 0; ++k, i >>= 1)
    if (i & 1u) x ^= v[k];
  return x;
}

// The low coordinates of a Sobol' sequence are the best ones: the pixel position gets the first two, then every block
// its seven used slots, directions before choices; what no one reads comes last. Returns the coordinate of each
// structural dimension.
std::vector<unsigned> dimensionOrder(unsigned blocks) {
  static constexpr unsigned kCamera[] = {slot::kPixelX, slot::kPixelY};
  static constexpr unsigned kVertex[] = {slot::kLightU, slot::kLightV,      slot::kBsdfU,   slot::kBsdfV,
                                         slot::kLobe,   slot::kLightSelect, slot::kRoulette};
  std::vector<unsigned> order(size_t(blocks) * kBlockSize, ~0u);
  unsigned next = 0;
  for (unsigned s : kCamera) order[s] = next++;
  for (unsigned b = 1; b < blocks; ++b)
    for (unsigned s : kVertex) order[b * kBlockSize + s] = next++;
  for (unsigned& o : order)
    if (o == ~0u) o = next++;
  return order;
}

}  // namespace

PassSampler::PassSampler(SamplerKind kind, uint64_t seed, uint64_t stream, uint64_t pass, unsigned blocks)
    : key_(hashCombine(hashCombine(mix64(seed + 1), stream),
                       kind == SamplerKind::Sobol ? pass % kSequenceBuckets : pass)) {
  if (kind == SamplerKind::Independent) return;
  index_ = static_cast<uint32_t>(pass / kSequenceBuckets);
  points_.resize(size_t(blocks) * kBlockSize);
  const std::vector<unsigned> order = dimensionOrder(blocks);
  for (size_t d = 0; d < points_.size(); ++d) points_[d] = reverseBits(sobolCoordinate(order[d], index_));
}

SampleBlock PassSampler::block(uint64_t itemKey, unsigned b) const {
  SampleBlock out;
  const auto lo = static_cast<uint32_t>(itemKey), hi = static_cast<uint32_t>(itemKey >> 32);
  const size_t first = size_t(b) * kBlockSize;
  alignas(32) uint32_t x[kBlockSize];
  if (first + kBlockSize <= points_.size()) {
    const uint32_t* point = points_.data() + first;
    for (unsigned i = 0; i < kBlockSize; ++i) {
      const uint32_t dimension = static_cast<uint32_t>(first) + i;
      const uint32_t seed = mix32((lo + dimension * 0x9e3779b9u) ^ hi);
      uint32_t r = point[i];
      r ^= r * 0x3d20adeau;
      r += seed;
      r *= (seed >> 16) | 1u;
      r ^= r * 0x05526c56u;
      r ^= r * 0x53a22864u;
      x[i] = reverseBits(r);
    }
  } else {
    // Past the table (or independent): the point index must be in the key, since the item key is shared by the passes
    // of a bucket.
    for (unsigned i = 0; i < kBlockSize; ++i) {
      const uint32_t dimension = static_cast<uint32_t>(first) + i;
      x[i] = mix32(mix32(lo + dimension * 0x9e3779b9u) ^ hi ^ (index_ * 0x85ebca6bu));
    }
  }
  for (unsigned i = 0; i < kBlockSize; ++i) out.u[i] = toUnit(x[i]);
  return out;
}

}  // namespace braid
