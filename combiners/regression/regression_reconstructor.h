// SPDX-License-Identifier: Apache-2.0
// Adds up the predictions of all models about a pixel (combiners/README.md, Regression), in gather form: a task owns
// its pixels and runs through the models in a fixed order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "combiners/regression/regression_fitter.h"
#include "combiners/regression/regression_job.h"

namespace braid::regression {

constexpr int kSlabRows = 4;         // pixel rows that one task reconstructs
constexpr double kLeastPixels = 2;   // that a model of a single pixel must rest on
constexpr int kOwnPerCell = 8;       // models of single pixels in a stride x kSlabRows cell
constexpr float kUnreached = 1e-5f;  // a sum of weights below this: no model reaches the pixel (released code)

// Sums the predictions of all models about the rows of one slab, in the order of the centres.
class Reconstructor {
 public:
  Reconstructor(const Job& job, Models& models)
      : job_(job),
        models_(models),
        pitch_(static_cast<size_t>(job.width) + WindowWeights::kRowSlack),
        sums_(pitch_ * static_cast<size_t>(kSlabRows * (job.colours + 1)), 0.0f),
        weights_(static_cast<size_t>(2 * job.settings.radius + 1 + WindowWeights::kRowSlack), 0.0f) {}

  // Adds all centre rows within reach of the pixel rows [y0, y1).
  void gather(int y0, int y1) {
    const RegressionSettings& s = job_.settings;
    const int rows = centreCount(job_.height, s.stride);
    for (int r = std::max(0, (y0 - s.radius) / s.stride - 1); r < rows; ++r) {
      const int cy = centrePosition(r, job_.height, s.stride);
      if (cy - s.radius >= y1) break;
      if (cy + s.radius < y0) continue;
      const Span ys{std::max(y0, cy - s.radius), std::min(y1, cy + s.radius + 1)};
      for (int column = 0; column < models_.columns(); ++column)
        addModel(models_.at(column, r), centrePosition(column, job_.width, s.stride), cy, ys, y0);
    }
  }

  // Gives the pixels of one row that too few models reach one of their own, which only they use. A model that rests on
  // its own pixel alone would return the noise: a lone glint keeps its fallback. At most kOwnPerCell of
  // them in the `stride` columns of a slab bound the cost of an image without likenesses.
  void addOwnModels(int y, int y0, Fitter& fitter, RegressionReport& report) {
    const RegressionSettings& s = job_.settings;
    if (y == y0) ownInCell_.assign(static_cast<size_t>(job_.width / s.stride + 1), 0);
    float* weight = sum(job_.colours, y - y0);
    for (int x = 0; x < job_.width; ++x) {
      int& count = ownInCell_[static_cast<size_t>(x / s.stride)];
      if (!(weight[x] < s.ownModelBelow) || count == kOwnPerCell || job_.cancelled()) continue;
      const double pixels = fitter.fit(x, y, own_.data(), report);
      ++count;
      ++report.ownModels;
      if (!(pixels >= kLeastPixels)) continue;
      const auto share = static_cast<float>(pixels / (s.stride * s.stride));
      for (int c = 0; c < job_.colours; ++c) sum(c, y - y0)[x] += share * own_[static_cast<size_t>(c)];
      weight[x] += share;
    }
  }

  // Writes one row of the result; returns how many of its pixels no model reached.
  uint64_t finish(int y, int y0, std::array<Rgb<float>, 2>& out) const {
    const float* weight = sum(job_.colours, y - y0);
    for (int c = 0; c < job_.colours; ++c) {
      const auto channel = static_cast<size_t>(c % 3);
      const Rgb<float>& fallback = c < 3 ? *job_.inputs.fallback : *job_.inputs.secondFallback;
      blend(sum(c, y - y0), weight, fallback[channel], y, out[static_cast<size_t>(c / 3)][channel]);
    }
    return static_cast<uint64_t>(std::count_if(weight, weight + job_.width, [](float w) { return w < kUnreached; }));
  }

 private:
  float* sum(int quantity, int row) {
    return sums_.data() + static_cast<size_t>(row * (job_.colours + 1) + quantity) * pitch_;
  }
  const float* sum(int quantity, int row) const { return const_cast<Reconstructor*>(this)->sum(quantity, row); }

  void blend(const float* sums, const float* weights, const Plane<float>& fallback, int y, Plane<float>& out) const {
    const float share = job_.settings.fallbackWeight;
    for (int x = 0; x < job_.width; ++x) {
      const float zeroOrder = fallback.at(x, y);
      const float mean = (sums[x] + share * zeroOrder) / (weights[x] + share);
      out.at(x, y) = weights[x] >= kUnreached && std::isfinite(mean) ? mean : zeroOrder;
    }
  }

  void addModel(const float* model, int cx, int cy, Span ys, int y0) {
    const Span xs = window(cx, job_.settings.radius, job_.width);
    const WindowWeights& weights =
        job_.inputs.reconstruction ? *job_.inputs.reconstruction : *job_.inputs.terms[0].weights;
    std::array<float, RegressionInputs::kMaxFeatures> centre;
    for (int k = 0; k < job_.features.planes(); ++k) centre[static_cast<size_t>(k)] = job_.features.row(k, cy)[cx];
    for (int y = ys.begin; y < ys.end; ++y) {
      weights.row(cx, cy, y, xs.begin, xs.end, weights_.data());
      std::fill_n(weights_.begin() + xs.length(), kLanes, 0.0f);
      if (job_.colours == 3)
        predictRow<3>(model, centre.data(), xs, y, y - y0);
      else
        predictRow<6>(model, centre.data(), xs, y, y - y0);
    }
  }

  // Adds the predictions of one model for one row of its window.
  template <size_t N>
  void predictRow(const float* model, const float* centre, Span xs, int y, int row) {
    const float* features =
        job_.features.planes() > 0 ? job_.features.row(0, y) + xs.begin : weights_.data();  // else not read
    float* out = sum(0, row) + xs.begin;
    int x = 0;
    for (; x + 2 * kLanes <= xs.length(); x += 2 * kLanes) predict<N, 2>(model, centre, features + x, x, out + x);
    for (; x < xs.length(); x += kLanes) predict<N, 1>(model, centre, features + x, x, out + x);
  }

  // The same for kUnits vectors: two at once, for the coefficients are loaded as often as the features otherwise.
  template <size_t N, size_t kUnits>
  void predict(const float* model, const float* centre, const float* features, int x, float* out) const {
    FloatLanes w[kUnits], colour[N][kUnits], d[kUnits], most{};
    for (size_t u = 0; u < kUnits; ++u) {
      w[u] = loadLanes(&weights_[static_cast<size_t>(x) + u * kLanes]);
      most = maxLanes(most, w[u]);
    }
    if (!anyLane(most >= kLeastWeight)) return;
    for (size_t c = 0; c < N; ++c)
      for (size_t u = 0; u < kUnits; ++u) colour[c][u] = broadcastLanes(model[c]);
    const size_t inPitch = job_.features.pitch(), outPitch = pitch_;
    const float* slope = model + N;
    for (int k = 0, end = job_.features.planes(); k < end; ++k, slope += N, features += inPitch) {
      for (size_t u = 0; u < kUnits; ++u) d[u] = loadLanes(features + u * kLanes) - centre[k];
#pragma GCC unroll 6
      for (size_t c = 0; c < N; ++c)
        for (size_t u = 0; u < kUnits; ++u) colour[c][u] += d[u] * slope[c];
    }
    for (size_t u = 0; u < kUnits; ++u, out += kLanes) {
      for (size_t c = 0; c < N; ++c)
        storeLanes(out + c * outPitch, loadLanes(out + c * outPitch) + w[u] * colour[c][u]);
      storeLanes(out + N * outPitch, loadLanes(out + N * outPitch) + w[u]);
    }
  }

  const Job& job_;
  Models& models_;
  const size_t pitch_;
  std::vector<float> sums_, weights_;
  std::vector<int> ownInCell_;
  std::array<float, NormalEquations::kMaxSize * NormalEquations::kMaxColours> own_{};
};

}  // namespace braid::regression
