// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw/pw_tile.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "combiners/pixels/least_albedo.h"
#include "combiners/pixels/mean_depth.h"
#include "combiners/statistics/variance.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr float kAlbedoSd = 0.25f, kNormalSd = 0.25f;
constexpr float kApart = 100;  // far more than guides differ by: 2^-(100²) is nothing
const float kAlbedoScale = std::sqrt(0.5f * kLog2E) / kAlbedoSd, kNormalScale = std::sqrt(0.5f * kLog2E) / kNormalSd;

inline float finiteOrZero(float v) { return std::fabs(v) <= std::numeric_limits<float>::max() ? v : 0.0f; }

// out = factor times what is finite of the row, in [low, high].
void copyRow(const float* __restrict in, int count, float factor, float low, float high, float* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = factor * std::min(std::max(finiteOrZero(in[x]), low), high);
}

// What a channel of the radiance is divided by, of its own albedo and those of the others. The albedo of a miss is the
// radiance of the environment, that of an emitter contains its emission.
void divisorRow(const float* __restrict own, const float* __restrict second, const float* __restrict third,
                const float* __restrict depth, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) {
    const float a = finiteOrZero(own[x]), b = finiteOrZero(second[x]), c = finiteOrZero(third[x]);
    const bool surface = std::max(std::max(a, b), c) <= 1 && (!depth || depth[x] != 0);
    out[x] = surface ? std::max(a, kLeastAlbedo) : 1.0f;
  }
}

void divideRow(const float* __restrict in, const float* __restrict divisor, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = finiteOrZero(in[x]) / divisor[x];
}

void divideBySquareRow(const float* __restrict in, const float* __restrict divisor, int count, float* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = in[x] / (divisor[x] * divisor[x]);
}

void setMissesApart(const float* __restrict depth, int count, float* __restrict guide) {
  for (int x = 0; x < count; ++x) guide[x] += depth[x] == 0 ? kApart : 0.0f;
}

}  // namespace

PatchWelchInput patchWelchInput(const Estimate& estimate, const Features* features, bool robustVariance) {
  PatchWelchInput input;
  input.features = features;
  input.images = {&estimate.mean};
  if (!estimate.half[0].empty() && !estimate.half[1].empty()) {
    input.images.push_back(&estimate.half[0]);
    input.images.push_back(&estimate.half[1]);
  }
  input.variance = regularisedVariance(estimate, robustVariance);
  input.passes = passesOf(estimate);
  if (features) input.depthScale = inverseMeanDepth(features->depth.mean);
  return input;
}

PatchWelchTile::PatchWelchTile(const PatchWelchInput& input, const PixelRect& pixels, int alignedColumn)
    : rect(pixels),
      radiance(input.images.size()),
      begin_(alignedColumn - roundUp(alignedColumn - pixels.x0 + kMargin, kUnit)) {
  BRAID_ASSERT(!input.variance.empty() && input.variance.size() == input.images[0]->size());
  pitch = roundUp(rect.x1 + kMargin - begin_, kUnit);
  const size_t size = static_cast<size_t>(pitch) * static_cast<size_t>(rect.height());
  const PixelBuffer<float> zeros(size, 0.0f);
  for (Plane3& image : radiance) image.fill(zeros);
  variance.fill(zeros);
  divisor.fill(PixelBuffer<float>(size, 1.0f));
  guide.fill(zeros);
  depth = visibility = zeros;
  runVectorised([&] {
    for (int y = rect.y0; y < rect.y1; ++y) storeRow(input, y);
  });
}

void PatchWelchTile::storeRow(const PatchWelchInput& input, int y) {
  const size_t from = input.variance[0].index(rect.x0, y);
  const auto at = static_cast<size_t>(index(rect.x0, y));
  const int count = rect.width();
  if (input.features) storeFeatures(*input.features, input.depthScale, from, at);
  for (size_t c = 0; c < 3; ++c) {
    divideBySquareRow(&input.variance[c][from], &divisor[c][at], count, &variance[c][at]);
    for (size_t k = 0; k < radiance.size(); ++k)
      divideRow(&(*input.images[k])[c][from], &divisor[c][at], count, &radiance[k][c][at]);
  }
}

void PatchWelchTile::storeFeatures(const Features& f, float depthScale, size_t from, size_t at) {
  constexpr float kMost = std::numeric_limits<float>::max();
  const int count = rect.width();
  const float* z = f.depth.mean.empty() ? nullptr : &f.depth.mean[from];
  if (!f.albedo.mean.empty()) {
    const Rgb<float>& albedo = f.albedo.mean;
    for (size_t c = 0; c < 3; ++c)
      divisorRow(&albedo[c][from], &albedo[(c + 1) % 3][from], &albedo[(c + 2) % 3][from], z, count, &divisor[c][at]);
    for (size_t c = 0; c < 3; ++c) copyRow(&albedo[c][from], count, kAlbedoScale, 0, 1, &guide[c][at]);
  }
  for (size_t c = 0; c < 3 && !f.normal.mean.empty(); ++c)
    copyRow(&f.normal.mean[c][from], count, kNormalScale, -kMost, kMost, &guide[3 + c][at]);
  if (z) {
    copyRow(z, count, depthScale, -kMost, kMost, &depth[at]);
    setMissesApart(z, count, &guide[0][at]);
  }
  if (!f.visibility.mean.empty()) copyRow(&f.visibility.mean[from], count, 1, -kMost, kMost, &visibility[at]);
}

}  // namespace braid
