// SPDX-License-Identifier: Apache-2.0
// What one pass of one integrator leaves in the film's pixels.
#include <algorithm>
#include <cmath>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/film.h"

namespace braid {

namespace {

bool acceptable(const Spectrum& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && !(v.x < 0 || v.y < 0 || v.z < 0);
}

}  // namespace

uint64_t PassPlanes::bytesPerPixel() const {
  const size_t colours = 1 + static_cast<size_t>(bias) + static_cast<size_t>(direct);
  return sizeof(float) * (3 * colours + (features ? kFeatureComponents : 0) + (coverage ? 1 : 0));
}

PassTarget::PassTarget(int width, int height, const PassPlanes& planes)
    : width_(width), height_(height), own_(width, height) {
  if (planes.splats) splats_.assign(3 * own_.size(), 0);
  if (planes.features) features_.assign(kFeatureComponents, Plane<float>(width, height));
  if (planes.coverage) coverage_ = Plane<float>(width, height);
  if (planes.bias) bias_ = Rgb<float>(width, height);
  if (planes.direct) direct_ = Rgb<float>(width, height);
}

bool PassTarget::add(int x, int y, const Spectrum& value) {
  const size_t i = own_[0].index(x, y);
  const bool ok = acceptable(value);
  own_.set(i, ok ? value : Spectrum(0));
  if (!ok) rejected_.fetch_add(1, std::memory_order_relaxed);
  return ok;
}

bool PassTarget::addSigned(int x, int y, const Spectrum& value) {
  const bool ok = isFinite(value);
  own_.set(own_[0].index(x, y), ok ? value : Spectrum(0));
  if (!ok) rejected_.fetch_add(1, std::memory_order_relaxed);
  return ok;
}

bool PassTarget::splat(int x, int y, const Spectrum& value) {
  BRAID_ASSERT(!splats_.empty() && x >= 0 && y >= 0 && x < width_ && y < height_);
  if (!acceptable(value)) {
    rejected_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  int64_t* pixel = &splats_[3 * own_[0].index(x, y)];
  bool clamped = false;
  for (int c = 0; c < 3; ++c) {
    const double v = static_cast<double>(value[c]);
    if (v == 0) continue;
    clamped |= v > splatClamp_;
    const auto fixed = static_cast<int64_t>(std::llrint(std::min(v, splatClamp_) * splatScale_));
    std::atomic_ref<int64_t>(pixel[c]).fetch_add(fixed, std::memory_order_relaxed);
  }
  if (clamped) clampedSplats_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

void PassTarget::setSplatFractionBits(int bits) {
  splatScale_ = std::ldexp(1.0, bits);
  splatClamp_ = std::ldexp(1.0, 54 - bits);
}

void PassTarget::features(int x, int y, const FeatureSample& sample) {
  const size_t i = own_[0].index(x, y);
  const auto values = sample.values();
  // A non-finite component would poison every window around it: it counts as 0, and the sample as rejected.
  bool ok = true;
  for (size_t c = 0; c < kFeatureComponents; ++c) {
    const bool finite = std::isfinite(values[c]);
    ok &= finite;
    features_[c][i] = finite ? values[c] : 0.0f;
  }
  if (!ok) rejected_.fetch_add(1, std::memory_order_relaxed);
}

void PassTarget::bias(int x, int y, const Spectrum& value) {
  const bool ok = isFinite(value);
  bias_.set(own_[0].index(x, y), ok ? value : Spectrum(0));
  if (!ok) rejected_.fetch_add(1, std::memory_order_relaxed);
}

void PassTarget::direct(int x, int y, const Spectrum& value) {
  direct_.set(own_[0].index(x, y), acceptable(value) ? value : Spectrum(0));
}

void PassTarget::clearFor(const std::vector<bool>& tiles) {
  BRAID_ASSERT(splats_.empty());
  constexpr int kTile = SamplePlacement::kTile;
  const int columns = (width_ + kTile - 1) / kTile;
  runs_.assign(tiles.size() / static_cast<size_t>(columns), {});
  for (size_t t = 0; t < tiles.size(); ++t) {
    if (!tiles[t]) continue;
    auto& runs = runs_[t / static_cast<size_t>(columns)];
    const int begin = static_cast<int>(t % static_cast<size_t>(columns)) * kTile, end = std::min(begin + kTile, width_);
    if (!runs.empty() && runs.back().second == begin)
      runs.back().second = end;
    else
      runs.emplace_back(begin, end);
  }
  rejected_ = 0;
  clampedSplats_ = 0;
}

void PassTarget::clear() {
  runs_.clear();
  const auto width = static_cast<size_t>(width_);
  parallelRows(height_, [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t c = 0; c < 3; ++c) std::fill_n(own_[c].data.begin() + static_cast<std::ptrdiff_t>(begin), width, 0.0f);
    for (Plane<float>& f : features_) std::fill_n(f.data.begin() + static_cast<std::ptrdiff_t>(begin), width, 0.0f);
    for (Rgb<float>* image : {&bias_, &direct_})
      for (Plane<float>& p : image->channel)
        if (!p.empty()) std::fill_n(p.data.begin() + static_cast<std::ptrdiff_t>(begin), width, 0.0f);
    if (!coverage_.empty()) std::fill_n(coverage_.data.begin() + static_cast<std::ptrdiff_t>(begin), width, 0.0f);
    if (!splats_.empty()) std::fill_n(splats_.begin() + static_cast<std::ptrdiff_t>(3 * begin), 3 * width, int64_t(0));
  });
  rejected_ = 0;
  clampedSplats_ = 0;
}

}  // namespace braid
