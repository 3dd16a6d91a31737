// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/rdfc/rdfc_features.h"

#include <cmath>

#include "combiners/denoise/rdfc/rdfc_window.h"

namespace braid {

namespace {

constexpr int kWindow = 5;
constexpr double kDepthQuantile = 0.999;
constexpr float kLargest = 1e9f;

// One channel of a feature before it is filtered. The variance or the halves may be missing.
struct RawChannel {
  Plane<float> mean, variance, half[2];
};
using RawFeature = std::vector<RawChannel>;

float finiteOrZero(float v) { return std::isfinite(v) ? std::clamp(v, -kLargest, kLargest) : 0.0f; }

// factor value(i) + offset for all planes of a channel; the variance by the factor alone.
template <class Factor>
RawChannel mapped(const Plane<float>& mean, const Plane<float>& a, const Plane<float>& b, const Plane<float>& variance,
                  const Factor& factor, float offset) {
  const auto affine = [&](const Plane<float>& in) {
    Plane<float> out(in.width, in.height, kUnfilled);
    parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[i] = factor(i) * finiteOrZero(in[i]) + offset;
    });
    return out;
  };
  RawChannel out = {affine(mean), Plane<float>(variance.width, variance.height, kUnfilled), {affine(a), affine(b)}};
  parallelChunks(variance.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out.variance[i] = factor(i) * factor(i) * std::max(0.0f, finiteOrZero(variance[i]));
  });
  return out;
}

const Plane<float> kNone;

template <class Factor>
RawFeature mappedFeature(const FeaturePlanes<Rgb<float>>& f, bool halves, const Factor& factor, float offset) {
  RawFeature out;
  for (size_t c = 0; c < 3 && !f.mean.empty(); ++c)
    out.push_back(
        mapped(f.mean[c], halves ? f.half[0][c] : kNone, halves ? f.half[1][c] : kNone, f.variance[c], factor, offset));
  return out;
}
RawFeature mappedFeature(const FeaturePlanes<Plane<float>>& f, bool halves, float factor) {
  RawFeature out;
  if (!f.mean.empty())
    out.push_back(mapped(
        f.mean, halves ? f.half[0] : kNone, halves ? f.half[1] : kNone, f.variance, [factor](size_t) { return factor; },
        0));
  return out;
}

float inverseQuantile(const Plane<float>& depth) {
  std::vector<float> hits;
  for (const float d : depth.data)
    if (std::isfinite(d) && d > 0) hits.push_back(d);
  if (hits.empty()) return 0;
  const auto at = static_cast<ptrdiff_t>(kDepthQuantile * static_cast<double>(hits.size() - 1));
  std::nth_element(hits.begin(), hits.begin() + at, hits.end());
  return 1 / std::max(hits[static_cast<size_t>(at)], 1 / kLargest);
}

constexpr int kFeatures = 4;

// One of them at a time, for its copies take memory; empty where it is missing.
RawFeature rawFeature(const Features& f, int which, bool halves) {
  const Rgb<float>& albedo = f.albedo.mean;
  const auto compress = [&albedo](size_t i) {
    return 1 / std::max(1.0f, std::max(std::max(finiteOrZero(albedo[0][i]), finiteOrZero(albedo[1][i])),
                                       finiteOrZero(albedo[2][i])));
  };
  const auto half = [](size_t) { return 0.5f; };
  switch (which) {
    case 0:
      return mappedFeature(f.normal, halves, half, 0.5f);
    case 1:
      return mappedFeature(f.albedo, halves, compress, 0);
    case 2:
      return mappedFeature(f.depth, halves, inverseQuantile(f.depth.mean));
    default:
      return mappedFeature(f.visibility, halves, 1);
  }
}

// Without variation nothing is kept apart.
bool varies(const RawFeature& feature) {
  for (const RawChannel& c : feature)
    for (const Plane<float>* p : {&c.mean, &c.half[0], &c.half[1]})
      if (std::any_of(p->data.begin(), p->data.end(), [p](float v) { return v != p->data[0]; })) return true;
  return false;
}

Plane<float> squaredGradient(const Plane<float>& f) {
  Plane<float> out(f.width, f.height);
  const auto alongAxis = [](float before, float here, float after) {
    const float a = 0.5f * (before - here), b = 0.5f * (after - here);
    return std::min(a * a, b * b);
  };
  parallelRows(f.height, [&](int y) {
    for (int x = 0; x < f.width; ++x) {
      float& g = out.at(x, y);
      if (x > 0 && x + 1 < f.width) g += alongAxis(f.at(x - 1, y), f.at(x, y), f.at(x + 1, y));
      if (y > 0 && y + 1 < f.height) g += alongAxis(f.at(x, y - 1), f.at(x, y), f.at(x, y + 1));
    }
  });
  return out;
}

Plane<float> variancePlane(const RawChannel& c, uint64_t passes) {
  if (!c.variance.empty()) return c.variance;
  if (!c.half[0].empty() && !c.half[1].empty()) return rdfcHalvesVariance(c.half[0], c.half[1], passes);
  return Plane<float>(c.mean.width, c.mean.height);
}

RdfcChannel channelOf(const Plane<float>& mean, const Plane<float>& variance) {
  Plane<float> spread = squaredGradient(mean);
  for (size_t i = 0; i < spread.size(); ++i) spread[i] = std::max(spread[i], variance[i]);
  return {MirroredPlane(mean), MirroredPlane(variance), MirroredPlane(spread)};
}

RdfcGuide filteredFeature(const RawFeature& raw, uint64_t passes, const std::atomic<bool>* cancel) {
  RdfcGuide own(raw.size());
  std::vector<MirroredPlane> targets;
  const bool halves = !raw[0].half[0].empty() && !raw[0].half[1].empty();
  for (size_t c = 0; c < raw.size(); ++c) {
    own[c].mean = MirroredPlane(raw[c].mean);
    own[c].variance = MirroredPlane(variancePlane(raw[c], passes));
    if (halves)
      for (const Plane<float>& half : raw[c].half) targets.emplace_back(half);
    else
      targets.push_back(own[c].mean);
  }
  RdfcWindowFilter filter;
  filter.guide = &own;
  filter.window = kWindow;
  const std::vector<Plane<float>> filtered = rdfcFiltered(filter, targets, cancel);

  RdfcGuide out(raw.size());
  const auto shareA = static_cast<float>(static_cast<double>((passes + 1) / 2) / static_cast<double>(passes));
  for (size_t c = 0; c < raw.size(); ++c) {
    Plane<float> mean = filtered[halves ? 2 * c : c], variance(mean.width, mean.height);
    if (halves) {
      const Plane<float>&a = filtered[2 * c], &b = filtered[2 * c + 1];
      for (size_t i = 0; i < mean.size(); ++i) mean[i] = shareA * a[i] + (1 - shareA) * b[i];
      variance = rdfcHalvesVariance(a, b, passes);
    }
    out[c] = channelOf(mean, variance);
  }
  return out;
}

}  // namespace

Plane<float> rdfcHalvesVariance(const Plane<float>& a, const Plane<float>& b, uint64_t passes) {
  constexpr float kSide = 0.1353f;  // exp(-2)
  const double n = static_cast<double>(passes), countA = static_cast<double>((passes + 1) / 2);
  const auto factor = static_cast<float>(countA * (n - countA) / (n * n));
  const int width = a.width, height = a.height;
  Plane<float> raw(width, height), rows(width, height), out(width, height);
  for (size_t i = 0; i < raw.size(); ++i) raw[i] = factor * (a[i] - b[i]) * (a[i] - b[i]);
  const auto smooth = [](float before, float here, float after, bool first, bool last) {
    const float wBefore = first ? 0 : kSide, wAfter = last ? 0 : kSide;
    return (wBefore * before + here + wAfter * after) / (wBefore + 1 + wAfter);
  };
  parallelRows(height, [&](int y) {
    for (int x = 0; x < width; ++x)
      rows.at(x, y) = smooth(raw.at(std::max(0, x - 1), y), raw.at(x, y), raw.at(std::min(width - 1, x + 1), y), x == 0,
                             x == width - 1);
  });
  parallelRows(height, [&](int y) {
    for (int x = 0; x < width; ++x)
      out.at(x, y) = smooth(rows.at(x, std::max(0, y - 1)), rows.at(x, y), rows.at(x, std::min(height - 1, y + 1)),
                            y == 0, y == height - 1);
  });
  return out;
}

std::vector<RdfcGuide> rdfcFeatures(const Features& features, uint64_t passes, const std::atomic<bool>* cancel) {
  std::vector<RdfcGuide> out;
  for (int k = 0; k < kFeatures; ++k) {
    const RawFeature raw = rawFeature(features, k, true);
    if (varies(raw)) out.push_back(filteredFeature(raw, passes, cancel));
  }
  return out;
}

std::vector<RdfcGuide> rdfcRawFeatures(const Features& features) {
  std::vector<RdfcGuide> out;
  for (int k = 0; k < kFeatures; ++k) {
    const RawFeature raw = rawFeature(features, k, false);
    if (!varies(raw)) continue;
    RdfcGuide guide;
    for (const RawChannel& c : raw)
      guide.push_back(channelOf(c.mean, c.variance.empty() ? Plane<float>(c.mean.width, c.mean.height) : c.variance));
    out.push_back(std::move(guide));
  }
  return out;
}

}  // namespace braid
