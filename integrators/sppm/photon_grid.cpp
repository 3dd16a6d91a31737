// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/photon_grid.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr size_t kChunk = 8192;

float signOf(float x) { return std::copysign(1.0f, x); }

}  // namespace

uint32_t packDirection(const Vec3& d, int bits) {
  const float scale = 1 / (std::abs(d.x) + std::abs(d.y) + std::abs(d.z));
  Vec2 o(d.x * scale, d.y * scale);
  if (d.z < 0) o = Vec2((1 - std::abs(o.y)) * signOf(o.x), (1 - std::abs(o.x)) * signOf(o.y));
  const auto steps = static_cast<float>((1u << bits) - 1);
  const auto quantised = [&](float x) {
    return static_cast<uint32_t>(std::lround(std::clamp(0.5f * x + 0.5f, 0.0f, 1.0f) * steps));
  };
  return quantised(o.x) | quantised(o.y) << bits;
}

Vec3 unpackDirection(uint32_t packed, int bits) {
  const uint32_t mask = (1u << bits) - 1;
  const float scale = 2 / static_cast<float>(mask);
  const float x = static_cast<float>(packed & mask) * scale - 1;
  const float y = static_cast<float>((packed >> bits) & mask) * scale - 1;
  const float z = 1 - std::abs(x) - std::abs(y);
  const float fold = std::max(-z, 0.0f);
  return glm::normalize(Vec3(x - signOf(x) * fold, y - signOf(y) * fold, z));
}

template <class PhotonType>
GridOf<PhotonType>::GridOf(std::vector<PhotonType> photons, const RadiusScale& scale) : scale_(scale) {
  BRAID_ASSERT(scale.smallest > 0 && scale.largest >= scale.smallest && photons.size() < (size_t(1) << 32));
  const float ratio = scale.largest / scale.smallest;
  largestRatio2_ = scale.perspective ? sqr(ratio) : sqr(scale.radius(0) / scale.smallest);
  levelScale2_ = sqr(scale.perMetre / scale.smallest);
  for (int level = 0; level <= levelOf(kInfinity); ++level)
    inverses_.push_back(std::ldexp(0.5f / scale.smallest, -level));

  // Counting sort by bucket. What several threads count in any order is put in order afterwards, within each bucket.
  const size_t count = photons.size();
  mask_ = std::bit_ceil(static_cast<uint32_t>(std::max<size_t>(count, 1024))) - 1;
  const size_t buckets = size_t(mask_) + 1;
  std::vector<uint32_t> bucket(count), order(count);
  start_.assign(buckets + 1, 0);
  parallelChunks(count, kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      bucket[i] = bucketOf(cellOf(photons[i].position));
      std::atomic_ref<uint32_t>(start_[bucket[i] + 1]).fetch_add(1, std::memory_order_relaxed);
    }
  });
  for (size_t b = 0; b < buckets; ++b) start_[b + 1] += start_[b];
  parallelChunks(count, kChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      // Fills each bucket from its end; start_ then holds the bucket's begin.
      const uint32_t place = std::atomic_ref<uint32_t>(start_[bucket[i] + 1]).fetch_sub(1, std::memory_order_relaxed);
      order[place - 1] = static_cast<uint32_t>(i);
    }
  });
  start_.erase(start_.begin());
  start_.push_back(static_cast<uint32_t>(count));
  photons_.resize(count);
  parallelChunks(buckets, kChunk, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) {
      if (start_[b + 1] - start_[b] > 1) std::sort(order.begin() + start_[b], order.begin() + start_[b + 1]);
      for (size_t i = start_[b]; i < start_[b + 1]; ++i) photons_[i] = photons[order[i]];
    }
  });
}

template class GridOf<Photon>;
template class GridOf<CausticPhoton>;

}  // namespace braid
