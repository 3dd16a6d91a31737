// SPDX-License-Identifier: Apache-2.0
// Random numbers as a pure function of (seed, stream, pass, item, dimension): no state, so any thread may ask for any
// sample.
//
// Dimensions are structural: block 0 belongs to the camera, block b to the b-th path vertex, and each of the 8 slots of
// a block has one use (Slot). A dimension therefore means the same in every pixel, which is what common random numbers
// need, and a block is computed at once, eight lanes wide.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "renderer/core/hash.h"
#include "renderer/core/vec.h"

namespace braid {

enum class SamplerKind { Independent, Sobol };

inline constexpr unsigned kBlockSize = 8;
// Low-discrepancy buckets: pass p is point p / 4 of the sequence of bucket p % 4, whatever the film stores.
inline constexpr uint64_t kSequenceBuckets = 4;

struct SampleBlock {
  alignas(32) std::array<float, kBlockSize> u;
};

// The slots of a path vertex's block, and of the camera's.
namespace slot {
inline constexpr unsigned kLightSelect = 0, kLightU = 1, kLightV = 2, kLobe = 3, kBsdfU = 4, kBsdfV = 5, kRoulette = 6,
                          kExtra = 7;
inline constexpr unsigned kPixelX = 0, kPixelY = 1, kLensU = 2, kLensV = 3, kTime = 4, kChannel = 5;
}  // namespace slot

// The points of one pass: what all its pixels share.
class PassSampler {
 public:
  // `stream` tells integrators (and sub-streams) apart. `blocks` low-discrepancy blocks are tabulated; later ones are
  // independent.
  PassSampler(SamplerKind kind, uint64_t seed, uint64_t stream, uint64_t pass, unsigned blocks = 24);

  // The key of one item (pixel or light path): its own scramble per bucket (sobol) or its own stream per pass
  // (independent).
  uint64_t itemKey(uint64_t item) const { return hashCombine(key_, item); }

  // Eight uniform variates in [0, 1) of block `b` for the item with this key.
  SampleBlock block(uint64_t itemKey, unsigned b) const;

  // A hash of the item, this pass and the ray's number, for decisions that need no stratification.
  uint32_t salt(uint64_t itemKey, uint32_t ray) const {
    return mix32(static_cast<uint32_t>(itemKey >> 32) ^
                 mix32(static_cast<uint32_t>(itemKey) + ray * 0x9e3779b9u + index_ * 0x85ebca6bu));
  }

 private:
  uint64_t key_;
  std::vector<uint32_t> points_;  // bit-reversed Sobol' coordinates of this pass, empty when independent
  uint32_t index_ = 0;
};

// One item of a pass.
struct ItemSampler {
  const PassSampler* pass;
  uint64_t key;
  SampleBlock block(unsigned b) const { return pass->block(key, b); }
  uint32_t salt(uint32_t ray) const { return pass->salt(key, ray); }
};

}  // namespace braid
