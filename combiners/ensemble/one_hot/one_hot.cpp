// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/one_hot/one_hot.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "combiners/pixels/window.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pipeline/method_names.h"

namespace braid {

namespace {

constexpr int kRadius = 16;
constexpr int kBlock = 256;
// Weights below 2^-80 are nothing, and their products would be subnormal numbers, which take hundreds of cycles.
constexpr float kLowestExponent = -80;
constexpr float kSpatial = 8.0f, kLeastVariance = 1e-2f;

// One feature: its components, the sum of their sample variances, and log2(e) / (2 sigma²).
struct Guide {
  std::vector<const Plane<float>*> mean;
  Plane<float> variance;
  float scale = 0;
};

Plane<float> sampleVariance(const std::vector<const Plane<float>*>& ofMean, double factor) {
  Plane<float> out(ofMean[0]->width, ofMean[0]->height);
  for (size_t i = 0; i < out.size(); ++i) {
    double sum = 0;
    for (const Plane<float>* v : ofMean) sum += static_cast<double>((*v)[i]);
    out[i] = finiteFloat(factor * sum);
  }
  return out;
}

double highQuantile(const Plane<float>& plane) {
  std::vector<float> values(plane.data.begin(), plane.data.end());
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at);
}

std::vector<Guide> guidesOf(const Features* features, double passes) {
  std::vector<Guide> guides;
  const auto add = [&](std::vector<const Plane<float>*> mean, const std::vector<const Plane<float>*>& variance,
                       double factor, double sigma) {
    if (mean[0]->empty()) return;
    // Dividing by `factor` here and in the variance keeps the planes as they are.
    guides.push_back({std::move(mean), sampleVariance(variance, passes / (factor * factor)),
                      static_cast<float>(static_cast<double>(kLog2E) / (2 * sigma * sigma * factor * factor))});
  };
  if (!features) return guides;
  const auto& n = features->normal;
  const auto& a = features->albedo;
  const auto& d = features->depth;
  add({&n.mean[0], &n.mean[1], &n.mean[2]}, {&n.variance[0], &n.variance[1], &n.variance[2]}, 1, 0.8);
  add({&a.mean[0], &a.mean[1], &a.mean[2]}, {&a.variance[0], &a.variance[1], &a.variance[2]}, 1, 0.25);
  if (!d.mean.empty()) {
    const double most = highQuantile(d.mean);
    if (most > 0) add({&d.mean}, {&d.variance}, most, 0.6);
  }
  return guides;
}

// Adds the term of one feature with `kPlanes` components to the exponents of `count` pixel pairs.
template <size_t kPlanes>
void addGuide(const Guide& guide, size_t p, size_t q, int count, float* __restrict exponent) {
  const float* at[kPlanes];
  for (size_t k = 0; k < kPlanes; ++k) at[k] = guide.mean[k]->data.data();
  const float* __restrict a = at[0] + p, * __restrict b = at[kPlanes / 2] + p, * __restrict c = at[kPlanes - 1] + p;
  const float* __restrict aq = at[0] + q, * __restrict bq = at[kPlanes / 2] + q, * __restrict cq = at[kPlanes - 1] + q;
  const float* __restrict v = guide.variance.data.data() + p, * __restrict vq = guide.variance.data.data() + q;
  const float scale = guide.scale;
  for (int x = 0; x < count; ++x) {
    float square = (a[x] - aq[x]) * (a[x] - aq[x]);
    if constexpr (kPlanes == 3) square += (b[x] - bq[x]) * (b[x] - bq[x]) + (c[x] - cq[x]) * (c[x] - cq[x]);
    exponent[x] += scale * square / std::max(v[x] + vq[x], kLeastVariance);
  }
}

// Pixels of one row, at most kBlock.
struct Block {
  int x0, y, count;
};

void filterBlock(const std::vector<Plane<float>>& in, const std::vector<Guide>& guides, const Block& block, float* sums,
                 std::vector<Plane<float>>& out) {
  const auto [x0, y, count] = block;
  const Plane<float>& shape = in[0];
  float norm[kBlock] = {}, kernel[kBlock];
  std::fill_n(sums, in.size() * kBlock, 0.0f);
  for (int dy = -std::min(kRadius, y); dy <= std::min(kRadius, shape.height - 1 - y); ++dy)
    for (int dx = -kRadius; dx <= kRadius; ++dx) {
      const int from = std::max(x0, -dx), to = std::min(x0 + count, shape.width - dx), n = to - from;
      if (n <= 0) continue;
      const size_t p = shape.index(from, y), q = shape.index(from + dx, y + dy);
      std::fill_n(kernel, n, static_cast<float>(dx * dx + dy * dy) * kLog2E / (2 * kSpatial * kSpatial));
      for (const Guide& guide : guides) {
        if (guide.mean.size() == 3)
          addGuide<3>(guide, p, q, n, kernel);
        else
          addGuide<1>(guide, p, q, n, kernel);
      }
      for (int x = 0; x < n; ++x) kernel[x] = exp2NonPositive(std::max(-kernel[x], kLowestExponent));
      float* normAt = norm + (from - x0);
      for (int x = 0; x < n; ++x) normAt[x] += kernel[x];
      for (size_t m = 0; m < in.size(); ++m) {
        float* __restrict sum = sums + m * kBlock + (from - x0);
        const float* __restrict value = in[m].data.data() + q;
        for (int x = 0; x < n; ++x) sum[x] += kernel[x] * value[x];
      }
    }
  for (size_t m = 0; m < in.size(); ++m)
    for (int x = 0; x < count; ++x) out[m].at(x0 + x, y) = sums[m * kBlock + static_cast<size_t>(x)] / norm[x];
}

}  // namespace

std::vector<Plane<float>> baseErrors(const Estimate& unbiased, const std::vector<const Estimate*>& bases) {
  const Rgb<float> variance = meanVariance(unbiased);
  std::vector<Plane<float>> errors;
  for (const Estimate* base : bases) errors.push_back(squaredErrorSamples(base->half, unbiased, variance));
  return errors;
}

WeightMaps selectionMaps(const std::vector<Plane<float>>& errors) {
  WeightMaps maps{errors.size(), 1, std::vector<Plane<float>>(errors.size(), {errors[0].width, errors[0].height})};
  for (size_t i = 0; i < errors[0].size(); ++i) {
    size_t best = 0;
    for (size_t b = 1; b < errors.size(); ++b)
      if (errors[b][i] < errors[best][i]) best = b;
    maps.planes[best][i] = 1;
  }
  return maps;
}

std::vector<Plane<float>> featureFiltered(const std::vector<Plane<float>>& in, const Features* features,
                                          uint64_t passes) {
  const std::vector<Guide> guides = guidesOf(features, static_cast<double>(passes));
  std::vector<Plane<float>> out = in;
  parallelRows(in[0].height, [&](int y) {
    std::vector<float> sums(in.size() * kBlock);
    for (int x0 = 0; x0 < in[0].width; x0 += kBlock)
      runVectorised([&] { filterBlock(in, guides, {x0, y, std::min(kBlock, in[0].width - x0)}, sums.data(), out); });
  });
  return out;
}

Needs oneHotNeeds() {
  Needs needs;
  needs.bases = 2;
  needs.variance = false;
  return needs;
}

MethodResult oneHotResult(const MethodInputs& in, const WeightMaps& weights, const char* method) {
  MethodResult result;
  result.image = weightedEstimate(weights, in.bases);
  result.error = crossHalfErrorMap(result.image.half, *in.unbiased, meanVariance(*in.unbiased), result.image.mean);
  for (size_t b = 0; b < in.bases.size(); ++b) {
    const std::string& base = in.bases[b]->name;
    result.aovs.push_back({std::string("weight.") + method + "." + (base.empty() ? std::to_string(b) : layerName(base)),
                           weights.planes[b]});
  }
  return result;
}

}  // namespace braid
