// SPDX-License-Identifier: Apache-2.0
// Fits the model of one centre (combiners/README.md, Regression).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "combiners/regression/normal_equations.h"
#include "combiners/regression/regression_job.h"
#include "combiners/regression/row_products.h"

namespace braid::regression {

// A window is cut into chunks of whole rows that fit the first-level cache; a chunk holds
// the rows sqrt(w) [1, f - f_c, x] of the weighted design matrix (DSCombiner Eq. 14), whose products are the normal
// equations.
class Fitter {
 public:
  explicit Fitter(const Job& job)
      : job_(job),
        size_(job.size()),
        blocks_((size_ + kRegisterBlock - 1) / kRegisterBlock),
        capacity_(std::max(256, 2 * job.settings.radius + 1)),
        pitch_((static_cast<size_t>(capacity_) + 15) / 16 * 16 + WindowWeights::kRowSlack),
        rows_(pitch_ / 16 * static_cast<size_t>(rhsRow() + job.colours)),
        weights_(job.inputs.terms.size(), std::vector<float>(pitch_, 0.0f)),
        roots_(pitch_),
        order_(pitch_ / kLanes) {}

  // Writes size() * colours coefficients of the unscaled features, colour by colour for each. Returns the sum of the
  // weights of a term, averaged over terms: how many pixels like the centre the model rests on.
  double fit(int cx, int cy, float* model, RegressionReport& report) {
    start(cx, cy);
    const Span xs = window(cx, job_.settings.radius, job_.width), ys = window(cy, job_.settings.radius, job_.height);
    for (int y = ys.begin; y < ys.end; ++y) {
      if (filled_ + xs.length() > capacity_) flush();
      append(cx, cy, y, xs);
    }
    flush();
    return finish(model, report) / static_cast<double>(weights_.size());
  }

 private:
  // One cache line: the chunk starts at one, lest half of all loads straddle two.
  struct alignas(64) Line {
    std::array<float, 16> values{};
  };

  float* row(int r) { return rows_.data()->values.data() + static_cast<size_t>(r) * pitch_; }
  int rowBlocks() const { return blocks_ + job_.colours / kRegisterBlock; }
  int rhsRow() const { return blocks_ * kRegisterBlock; }  // after the design rows, which are padded by rows of zeros

  void start(int cx, int cy) {
    filled_ = 0;
    sums_.fill(FloatLanes{});
    farthest_.fill(FloatLanes{});
    for (int k = 0; k + 1 < size_; ++k) centre_[static_cast<size_t>(k)] = job_.features.row(k, cy)[cx];
  }

  // Adds a row of the window to the chunk.
  void append(int cx, int cy, int y, Span xs) {
    for (size_t t = 0; t < weights_.size(); ++t)
      job_.inputs.terms[t].weights->row(cx, cy, y, xs.begin, xs.end, weights_[t].data());
    if (job_.colours == 3)
      weights_.size() == 1 ? appendRow<3, false>(y, xs) : appendRow<3, true>(y, xs);
    else
      weights_.size() == 1 ? appendRow<6, false>(y, xs) : appendRow<6, true>(y, xs);
  }

  // The same, from its weights. All rows of the design matrix are made at once, for loops over a few vectors each would
  // wait for their ends; two vectors at a time, after the roots and quotients of all of them, whose latency a single
  // vector's work does not hide.
  template <size_t kColours, bool kShared>
  void appendRow(int y, Span xs) {
    const int planes = job_.features.planes();
    const float* features = planes > 0 ? job_.features.row(0, y) + xs.begin : weights_[0].data();  // else not read
    const float* targets = job_.targets.row(0, y) + xs.begin;
    prefetch(job_.features, features, xs.length());
    prefetch(job_.targets, targets, xs.length());
    const int kept = sortVectors<kShared>(xs.length()), all = (xs.length() + kLanes - 1) / kLanes;
    for (int m = kept; m < all; ++m) measure(features, order_[static_cast<size_t>(m)], xs.length());
    for (int m = 0; m < kept; m += 2) {
      const int* at = &order_[static_cast<size_t>(m)];
      if (m + 1 < kept)
        appendVectors<2, kColours, kShared>(features, targets, at, xs.length());
      else
        appendVectors<1, kColours, kShared>(features, targets, at, xs.length());
    }
  }

  // Turns the weights of a row into roots sqrt(w), and with several terms into w_t / sqrt(Σ_t w_t). Lanes past the end
  // of the row weigh nothing. Writes the offsets of the vectors that weigh something, in order, and behind them those
  // of the others; returns how many the former are.
  template <bool kShared>
  int sortVectors(int length) {
    int kept = 0, left = (length + kLanes - 1) / kLanes;
    for (int x = 0; x < length; x += kLanes) {
      const IntLanes inside = laneIndices() < static_cast<float>(length - x);
      const auto at = static_cast<size_t>(x);
      FloatLanes weight = loadLanes(&weights_[0][at]);
      for (size_t t = 1; kShared && t < weights_.size(); ++t) weight += loadLanes(&weights_[t][at]);
      weight = inside ? weight : FloatLanes{};
      const FloatLanes root = sqrtLanes(weight);
      storeLanes(&roots_[at], root);
      if constexpr (kShared) {
        const FloatLanes inverse = root > 0.0f ? 1.0f / root : FloatLanes{};
        for (std::vector<float>& w : weights_) storeLanes(&w[at], loadLanes(&w[at]) * inverse);
      }
      (anyLane(weight >= kLeastWeight) ? order_[static_cast<size_t>(kept++)] : order_[static_cast<size_t>(--left)]) = x;
    }
    return kept;
  }

  // What the window of the next centre reads beyond this one: hundreds of rows are too many for the processor to
  // foresee (combiners/EXPERIMENTS.md, Speed of inner loops).
  static void prefetch(const PackedRows& planes, const float* row, int length) {
    for (int k = 0; k < planes.planes(); ++k, row += planes.pitch()) __builtin_prefetch(row + length + kLanes);
  }

  // The largest squared distance in every group so far, with a vector that weighs nothing.
  void measure(const float* features, int at, int length) {
    const IntLanes inside = laneIndices() < static_cast<float>(length - at);
    const float* in = features + at;
    for (size_t g = 0, k = 0; g < job_.groupEnd.size(); ++g) {
      FloatLanes distance{};
      for (const auto end = static_cast<size_t>(job_.groupEnd[g]); k < end; ++k, in += job_.features.pitch()) {
        const FloatLanes d = loadLanes(in) - centre_[k];
        distance += d * d;
      }
      farthest_[g] = maxLanes(farthest_[g], inside ? distance : FloatLanes{});
    }
  }

  // Appends kUnits vectors of a row, one or two, to the rows sqrt(w) [1, f - f_c], and their targets.
  template <int kUnits, size_t kColours, bool kShared>
  void appendVectors(const float* features, const float* targets, const int* at, int length) {
    const size_t inPitch = job_.features.pitch(), outPitch = pitch_;
    const IntLanes inside = laneIndices() < static_cast<float>(length - at[kUnits - 1]);
    float* out = row(0) + filled_;
    FloatLanes root[kUnits];
    const float* in[kUnits];
    for (int u = 0; u < kUnits; ++u) {
      root[u] = loadLanes(&roots_[static_cast<size_t>(at[u])]);
      storeLanes(out + u * kLanes, root[u]);
      in[u] = features + at[u];
    }
    for (size_t g = 0, k = 0; g < job_.groupEnd.size(); ++g) {
      FloatLanes distance[kUnits] = {};
      for (const auto end = static_cast<size_t>(job_.groupEnd[g]); k < end; ++k) {
        out += outPitch;
        const FloatLanes centre = broadcastLanes(centre_[k]);
        for (int u = 0; u < kUnits; ++u) {
          const FloatLanes d = loadLanes(in[u]) - centre;
          in[u] += inPitch;
          distance[u] += d * d;
          storeLanes(out + u * kLanes, root[u] * d);
        }
      }
      distance[kUnits - 1] = inside ? distance[kUnits - 1] : FloatLanes{};
      for (const FloatLanes& d : distance) farthest_[g] = maxLanes(farthest_[g], d);
    }
    for (int u = 0; u < kUnits; ++u)
      appendTargets<kColours, kShared>(targets, at[u], root[u], row(rhsRow()) + filled_ + u * kLanes);
    filled_ += (kUnits - 1) * kLanes + std::min(kLanes, length - at[kUnits - 1]);
  }

  // Rows sqrt(w) x; with several terms Σ_t w_t x_t / sqrt(Σ_t w_t).
  template <size_t kColours, bool kShared>
  void appendTargets(const float* targets, int at, FloatLanes root, float* out) const {
    const size_t pitch = job_.targets.pitch(), outPitch = pitch_;
    const float* in = targets + at;
    FloatLanes rhs[kColours], scale = kShared ? loadLanes(&weights_[0][static_cast<size_t>(at)]) : root;
    for (size_t c = 0; c < kColours; ++c, in += pitch) rhs[c] = scale * loadLanes(in);
    for (size_t t = 1; kShared && t < weights_.size(); ++t) {
      scale = loadLanes(&weights_[t][static_cast<size_t>(at)]);
      for (size_t c = 0; c < kColours; ++c, in += pitch) rhs[c] += scale * loadLanes(in);
    }
    for (size_t c = 0; c < kColours; ++c) storeLanes(out + c * outPitch, rhs[c]);
  }

  // Adds the products of the chunk's rows to the sums: the lower triangle of the Gram matrix, and the right-hand sides
  // with all of its rows. Of a last block of one row only that is multiplied; together with the triangles that saves a
  // fifth of the products of 13 rows and 6 sides.
  void flush() {
    for (int r = 0; r < rhsRow() + job_.colours; ++r) std::fill_n(row(r) + filled_, kLanes, 0.0f);
    const bool single = size_ % kRegisterBlock == 1;
    FloatLanes* sums = sums_.data();
    for (int i = 0; i < rowBlocks(); ++i)
      for (int j = 0; j < std::min(i + 1, blocks_); ++j, sums += kRegisterBlock * kRegisterBlock) {
        const RowBlocks rows = {row(i * kRegisterBlock), row(j * kRegisterBlock), pitch_, filled_};
        const bool oneRow = single && i == blocks_ - 1, oneColumn = single && j == blocks_ - 1;
        if (oneRow)
          oneColumn ? addProducts<1, 1>(rows, sums) : addProducts<1, 3>(rows, sums);
        else if (oneColumn)
          addProducts<3, 1>(rows, sums);
        else
          i == j ? addOwnProducts(rows, sums) : addProducts<3, 3>(rows, sums);
      }
    filled_ = 0;
  }

  // Scales the features, solves, and undoes the scales in the coefficients. Returns the sum of all weights.
  double finish(float* model, RegressionReport& report) {
    std::array<double, NormalEquations::kMaxSize> scale;
    scale.fill(1.0);
    if (job_.settings.scaleOffset >= 0)
      for (size_t g = 0, k = 0; g < job_.groupEnd.size(); ++g)
        for (; k < static_cast<size_t>(job_.groupEnd[g]); ++k)
          scale[k + 1] = 1 / (std::sqrt(static_cast<double>(maxOfLanes(farthest_[g]))) +
                              std::max(1e-30, static_cast<double>(job_.settings.scaleOffset)));
    const NormalEquations equations = gather(scale);
    const bool relative = job_.settings.ridgeKind == Ridge::RelativeToTrace;
    double trace = 0;
    for (size_t i = 0; i < static_cast<size_t>(size_); ++i) trace += equations.matrix[i][i];
    const double ridge = relative ? job_.settings.ridge * trace / size_ : job_.settings.ridge;
    const NormalSolution solution = solve(equations, ridge, !relative);
    ++report.models;
    report.raisedRidge += solution.raisedRidge && !solution.constant;
    report.constantModels += solution.constant;
    report.maxCondition = std::max(report.maxCondition, solution.condition);
    for (size_t k = 0; k < static_cast<size_t>(size_); ++k)
      for (size_t c = 0; c < static_cast<size_t>(job_.colours); ++c)
        *model++ = static_cast<float>(solution.coefficients[k][c] * scale[k]);
    return equations.matrix[0][0];
  }

  NormalEquations gather(const std::array<double, NormalEquations::kMaxSize>& scale) const {
    NormalEquations equations;
    equations.size = size_;
    equations.colours = job_.colours;
    const FloatLanes* sums = sums_.data();
    for (int i = 0; i < rowBlocks(); ++i)
      for (int j = 0; j < std::min(i + 1, blocks_); ++j)
        for (int a = i * kRegisterBlock; a < (i + 1) * kRegisterBlock; ++a)
          for (int b = j * kRegisterBlock; b < (j + 1) * kRegisterBlock; ++b, ++sums) {
            if (b >= size_ || (i < blocks_ && a >= size_)) continue;
            const auto column = static_cast<size_t>(b);
            const double sum = static_cast<double>(sumLanes(*sums)) * scale[column];
            if (i < blocks_)
              equations.matrix[static_cast<size_t>(a)][column] = sum * scale[static_cast<size_t>(a)];
            else
              equations.rhs[column][static_cast<size_t>(a - rhsRow())] = sum;
          }
    return equations;
  }

  static constexpr size_t kMaxBlocks = NormalEquations::kMaxSize / kRegisterBlock;

  const Job& job_;
  const int size_, blocks_, capacity_;
  const size_t pitch_;
  int filled_ = 0;
  std::vector<Line> rows_;
  std::vector<std::vector<float>> weights_;  // of every term, of one row of the window; with several, over their root
  std::vector<float> roots_;                 // of the sum of the weights
  std::vector<int> order_;                   // of the vectors of that row
  std::array<float, RegressionInputs::kMaxFeatures> centre_{};
  static constexpr size_t kMaxColourBlocks = NormalEquations::kMaxColours / kRegisterBlock;
  std::array<FloatLanes, kMaxBlocks*(kMaxBlocks + 1 + 2 * kMaxColourBlocks) / 2 * kRegisterBlock * kRegisterBlock>
      sums_;
  std::array<FloatLanes, RegressionInputs::kMaxFeatures> farthest_;
};

}  // namespace braid::regression
