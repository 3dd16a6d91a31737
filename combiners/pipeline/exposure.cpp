// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/exposure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kTile = 16;
constexpr double kMiddleGrey = 0.18;
constexpr double kDarkest = 1e-8;  // of the brightest tile
constexpr float kLargest = 1e9f;   // of normalised colours and of features

double meanLuminance(const Rgb<float>& image, int x0, int y0, int x1, int y1) {
  double sum = 0;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      const size_t i = image[0].index(x, y);
      const double l = 0.2126 * static_cast<double>(image[0][i]) + 0.7152 * static_cast<double>(image[1][i]) +
                       0.0722 * static_cast<double>(image[2][i]);
      if (std::isfinite(l)) sum += l;
    }
  return sum / (static_cast<double>(x1 - x0) * (y1 - y0));
}

constexpr float kAnyFinite = std::numeric_limits<float>::lowest();

// The product in double: k² of scenes in physical units is out of the range of floats sooner than the product. What
// leaves the range stays at its end.
float times(float value, double k) {
  constexpr auto kEnd = static_cast<double>(std::numeric_limits<float>::max());
  return static_cast<float>(std::clamp(static_cast<double>(value) * k, -kEnd, kEnd));
}

// What becomes of the values of a plane.
struct Change {
  double factor;
  float lowest, largest;
};

float changed(float value, const Change& change, SanitiseReport& report) {
  if (!std::isfinite(value)) return ++report.nonFinite, 0.0f;
  if (value < change.lowest) return ++report.negativeVariance, 0.0f;
  const float product = times(value, change.factor);
  if (std::fabs(product) <= change.largest) return product;
  ++report.outOfRange;
  return std::copysign(change.largest, product);
}

// The products, and whether no value needs more than that: nearly always, and in vectors. No number passes no test.
bool onlyMultiplied(const float* in, size_t count, const Change& change, float* out) {
  int good = 1;
  for (size_t i = 0; i < count; ++i) {
    out[i] = times(in[i], change.factor);
    good &= static_cast<int>(in[i] >= change.lowest) & static_cast<int>(std::fabs(out[i]) <= change.largest);
  }
  return good != 0;
}

// Whether all values are within the range of a change.
bool within(const Plane<float>& in, const Change& change) {
  return parallelSum(in.size(), kPixelChunk, 0, [&](size_t begin, size_t end) {
           int bad = 0;
           for (size_t i = begin; i < end; ++i)
             bad |=
                 static_cast<int>(!(in[i] >= change.lowest)) | static_cast<int>(!(std::fabs(in[i]) <= change.largest));
           return bad;
         }) == 0;
}

bool within(const Rgb<float>& in, const Change& change) {
  return within(in[0], change) && within(in[1], change) && within(in[2], change);
}

Plane<float> changed(const Plane<float>& in, const Change& change, SanitiseReport& report) {
  Plane<float> out(in.width, in.height, kUnfilled);
  report += parallelSum(in.size(), kPixelChunk, SanitiseReport{}, [&](size_t begin, size_t end) {
    SanitiseReport part;
    if (onlyMultiplied(&in[begin], end - begin, change, &out[begin])) return part;
    for (size_t i = begin; i < end; ++i) out[i] = changed(in[i], change, part);
    return part;
  });
  return out;
}

Rgb<float> changed(const Rgb<float>& in, const Change& change, SanitiseReport& report) {
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = changed(in[c], change, report);
  return out;
}

Change colours(double k) { return {k, kAnyFinite, kLargest}; }
Change variances(double k) { return {k * k, 0.0f, kLargest * kLargest}; }

template <class P>
FeaturePlanes<P> changed(const FeaturePlanes<P>& in, bool noise, SanitiseReport& report) {
  FeaturePlanes<P> out;
  out.mean = changed(in.mean, colours(1), report);
  if (!noise) return out;
  for (size_t h = 0; h < 2; ++h) out.half[h] = changed(in.half[h], colours(1), report);
  out.variance = changed(in.variance, variances(1), report);
  return out;
}

template <class P>
bool isSane(const FeaturePlanes<P>& in, bool noise) {
  if (!within(in.mean, colours(1))) return false;
  return !noise ||
         (within(in.half[0], colours(1)) && within(in.half[1], colours(1)) && within(in.variance, variances(1)));
}

Checkpoint changed(const Checkpoint& in, double k, SanitiseReport& report) {
  Checkpoint out;
  out.passes = in.passes;
  out.seconds = in.seconds;
  out.variance = changed(in.variance, variances(k), report);
  out.mean = changed(in.mean, colours(k), report);
  for (size_t h = 0; h < 2; ++h) out.half[h] = changed(in.half[h], colours(k), report);
  return out;
}

void multiply(Plane<float>& plane, double k) {
  parallelChunks(plane.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) plane[i] = times(plane[i], k);
  });
}
void multiply(Rgb<float>& image, double k) {
  for (Plane<float>& p : image.channel) multiply(p, k);
}

}  // namespace

double exposureScale(const Rgb<float>& image) {
  std::vector<double> tiles;
  const int columns = (image.width() + kTile - 1) / kTile, rows = (image.height() + kTile - 1) / kTile;
  // Tiles of nearly equal size: none is a sliver at the border.
  const auto cut = [](int i, int count, int size) {
    return static_cast<int>(static_cast<int64_t>(i) * size / std::max(count, 1));
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i)
      tiles.push_back(meanLuminance(image, cut(i, columns, image.width()), cut(j, rows, image.height()),
                                    cut(i + 1, columns, image.width()), cut(j + 1, rows, image.height())));
  const double brightest = tiles.empty() ? 0 : *std::max_element(tiles.begin(), tiles.end());
  double sum = 0;
  int count = 0;
  for (const double l : tiles)
    if (l > 0 && l > kDarkest * brightest) {
      sum += std::log2(l);
      ++count;
    }
  return count > 0 ? kMiddleGrey / std::exp2(sum / count) : 1.0;
}

Estimate normalised(const Estimate& e, double k, SanitiseReport& report, bool quarters, bool directIndirect) {
  Estimate out;
  static_cast<EstimateHead&>(out) = e;
  out.mean = changed(e.mean, colours(k), report);
  for (size_t h = 0; h < 2; ++h) out.half[h] = changed(e.half[h], colours(k), report);
  if (quarters)
    for (const Rgb<float>& q : e.quarter) out.quarter.push_back(changed(q, colours(k), report));
  out.variance = changed(e.variance, variances(k), report);
  out.bias = changed(e.bias, colours(k), report);
  for (size_t h = 0; h < 2; ++h) out.biasHalf[h] = changed(e.biasHalf[h], colours(k), report);
  out.biasVariance = changed(e.biasVariance, variances(k), report);
  if (!directIndirect) return out;
  out.direct.mean = changed(e.direct.mean, colours(k), report);
  for (size_t h = 0; h < 2; ++h) out.direct.half[h] = changed(e.direct.half[h], colours(k), report);
  out.direct.variance = changed(e.direct.variance, variances(k), report);
  out.indirectVariance = changed(e.indirectVariance, variances(k), report);
  return out;
}

Estimates normalised(const Estimates& all, double k, SanitiseReport& report, const PlanesRead& planes) {
  const KeptBuffers& read = planes.buffers;
  Estimates out;
  static_cast<EstimatesHead&>(out) = all;
  for (const Estimate& e : all.estimates)
    out.estimates.push_back(normalised(e, k, report, read.quarters, read.directIndirect));
  if (read.history)
    for (const auto& [name, checkpoints] : all.history)
      for (const Checkpoint& c : checkpoints) out.history[name].push_back(changed(c, k, report));
  if (planes.reference) out.reference = changed(all.reference, colours(k), report);
  if (!all.features || !read.features) return out;
  Features& features = out.features.emplace();
  forEachFeature(*all.features, features,
                 [&](const auto& from, auto& to) { to = changed(from, read.featureNoise, report); });
  return out;
}

bool isSane(const Features& f, bool noise) {
  bool sane = true;
  forEachFeature(f, [&](const auto& planes) { sane = sane && isSane(planes, noise); });
  return sane;
}

void undoExposure(MethodResult& result, double k) {
  const double back = 1 / k;
  Estimate& e = result.image;
  for (Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.bias, &e.biasHalf[0], &e.biasHalf[1]})
    multiply(*image, back);
  for (Rgb<float>& q : e.quarter) multiply(q, back);
  for (Rgb<float>* variance : {&e.variance, &e.biasVariance}) multiply(*variance, back * back);
  multiply(result.error, back * back);
}

}  // namespace braid
