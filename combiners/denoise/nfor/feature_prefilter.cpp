// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/nfor/feature_prefilter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/denoise/nlm/nlm_filter.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr float kSensitivity = 0.5f;
constexpr int kPatch = 3, kCrossWindow = 5, kMeanWindow = 2;

// One channel before filtering. The variance is that of the mean.
struct RawChannel {
  Plane<float> half[2], variance;
};

template <class Value>
Plane<float> planeOf(int width, int height, const Value& value) {
  Plane<float> out(width, height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float v = value(i);
      out[i] = std::isfinite(v) ? v : 0.0f;
    }
  });
  return out;
}

Plane<float> quarterOfSquaredDifference(const Plane<float>& a, const Plane<float>& b) {
  return planeOf(a.width, a.height, [&](size_t i) { return 0.25f * (a[i] - b[i]) * (a[i] - b[i]); });
}

// The channel times `scale`.
RawChannel rawChannel(const Plane<float>& mean, const Plane<float>& a, const Plane<float>& b,
                      const Plane<float>& variance, float scale) {
  RawChannel raw;
  const bool halves = !a.empty() && !b.empty();
  const Plane<float>* from[2] = {halves ? &a : &mean, halves ? &b : &mean};
  for (int h = 0; h < 2; ++h)
    raw.half[h] = planeOf(mean.width, mean.height, [&](size_t i) { return scale * (*from[h])[i]; });
  raw.variance = variance.empty() ? quarterOfSquaredDifference(raw.half[0], raw.half[1])
                                  : planeOf(mean.width, mean.height,
                                            [&](size_t i) { return std::max(0.0f, scale * scale * variance[i]); });
  return raw;
}

float highPercentile(const Plane<float>& in) {
  std::vector<float> values(in.data.begin(), in.data.end());
  for (float& v : values) v = std::isfinite(v) ? v : 0.0f;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

bool varies(const RawChannel& raw) {
  const auto differs = [&](const Plane<float>& p) {
    return std::any_of(p.data.begin(), p.data.end(), [&](float v) { return v != raw.half[0][0]; });
  };
  return differs(raw.half[0]) || differs(raw.half[1]);
}

// The groups of channels that are there and vary.
struct RawGroups {
  std::vector<std::vector<RawChannel>> groups;
  bool hasAlbedo = false;

  bool add(std::vector<RawChannel> group) {
    if (std::none_of(group.begin(), group.end(), varies)) return false;
    groups.push_back(std::move(group));
    return true;
  }
};

RawGroups rawGroups(const Features& features) {
  RawGroups raw;
  for (const FeaturePlanes<Rgb<float>>* f : {&features.albedo, &features.normal}) {
    if (f->mean.empty()) continue;
    std::vector<RawChannel> group;
    for (size_t c = 0; c < 3; ++c)
      group.push_back(rawChannel(f->mean[c], f->half[0][c], f->half[1][c], f->variance[c], 1));
    const bool kept = raw.add(std::move(group));
    if (f == &features.albedo) raw.hasAlbedo = kept;
  }
  for (const FeaturePlanes<Plane<float>>* f : {&features.depth, &features.visibility}) {
    if (f->mean.empty()) continue;
    const float far = f == &features.depth ? highPercentile(f->mean) : 1.0f;
    if (far > 0) raw.add({rawChannel(f->mean, f->half[0], f->half[1], f->variance, 1 / far)});
  }
  return raw;
}

Plane<float> filtered(const Plane<float>& in, const Plane<float>& guideMean, const Plane<float>& variance,
                      float varianceScale, int window) {
  NlmGuide guide = nlmGuide(guideMean, variance, kSensitivity, kPatch);
  guide.varianceScale = varianceScale;
  Plane<float> out(in.width, in.height);
  const std::array from = {&in};
  const std::array to = {&out};
  nlmFilter(std::span(&guide, 1), window, from, to);
  return out;
}

}  // namespace

std::vector<FeatureGroup> FeatureChannels::groups() const {
  std::vector<FeatureGroup> list;
  auto next = planes.begin();
  for (const size_t size : groupSizes) {
    FeatureGroup group;
    for (size_t k = 0; k < size; ++k) group.push_back(&*next++);
    list.push_back(std::move(group));
  }
  return list;
}

FeatureHalves crossPrefiltered(const Features* features) {
  FeatureHalves out;
  if (!features) return out;
  const RawGroups raw = rawGroups(*features);
  out.half[0].hasAlbedo = out.half[1].hasAlbedo = raw.hasAlbedo;
  for (const std::vector<RawChannel>& group : raw.groups) {
    for (size_t h = 0; h < 2; ++h) {
      out.half[h].groupSizes.push_back(group.size());
      for (const RawChannel& c : group)
        out.half[h].planes.push_back(filtered(c.half[h], c.half[1 - h], c.variance, 2, kCrossWindow));
    }
  }
  return out;
}

FeatureChannels prefilteredMean(const FeatureHalves& halves) {
  FeatureChannels out;
  out.groupSizes = halves.half[0].groupSizes;
  out.hasAlbedo = halves.half[0].hasAlbedo;
  for (size_t k = 0; k < halves.half[0].planes.size(); ++k) {
    const Plane<float>&a = halves.half[0].planes[k], &b = halves.half[1].planes[k];
    const Plane<float> mean = planeOf(a.width, a.height, [&](size_t i) { return 0.5f * a[i] + 0.5f * b[i]; });
    out.planes.push_back(filtered(mean, mean, quarterOfSquaredDifference(a, b), 1, kMeanWindow));
  }
  return out;
}

}  // namespace braid
