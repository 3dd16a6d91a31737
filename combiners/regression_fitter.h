// SPDX-License-Identifier: Apache-2.0
// Fits the model of one centre (ALGORITHMS 1.2 steps 2-4, 3.2).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "combiners/normal_equations.h"
#include "combiners/regression_job.h"

namespace braid::regression {

constexpr int kRegisterBlock = 3;  // the Gram matrix is summed in blocks of 3 x 3: nine sums, which every ISA can hold

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
        root_(pitch_, 0.0f),
        weights_(job.inputs.terms.size(), std::vector<float>(pitch_, 0.0f)) {}

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

  // Root of the summed weights of one row of the window, and the weights themselves.
  void weigh(int cx, int cy, int y, Span xs) {
    for (size_t t = 0; t < weights_.size(); ++t)
      job_.inputs.terms[t].weights->row(cx, cy, y, xs.begin, xs.end, weights_[t].data());
    for (int x = 0; x < xs.length(); x += kLanes) {
      FloatLanes sum = loadLanes(&weights_[0][static_cast<size_t>(x)]);
      for (size_t t = 1; t < weights_.size(); ++t) sum += loadLanes(&weights_[t][static_cast<size_t>(x)]);
      storeLanes(&root_[static_cast<size_t>(x)], sqrtLanes(sum));
    }
    std::fill_n(root_.begin() + xs.length(), kLanes, 0.0f);
  }

  void append(int cx, int cy, int y, Span xs) {
    weigh(cx, cy, y, xs);
    std::copy_n(root_.begin(), xs.length(), row(0) + filled_);
    for (size_t g = 0; g < job_.groupEnd.size(); ++g) {
      const int first = g == 0 ? 0 : job_.groupEnd[g - 1];
      if (job_.groupEnd[g] - first == 1) appendGroup<1>(first, y, xs, farthest_[g]);
      if (job_.groupEnd[g] - first == 2) appendGroup<2>(first, y, xs, farthest_[g]);
      if (job_.groupEnd[g] - first == 3) appendGroup<3>(first, y, xs, farthest_[g]);
    }
    for (int x = 0; x < xs.length(); x += kLanes)
      appendTargets(y, xs.begin + x, x, loadLanes(&root_[static_cast<size_t>(x)]));
    filled_ += xs.length();
  }

  // Rows of the feature planes [first, first + N), and their largest squared distance so far.
  template <int N>
  void appendGroup(int first, int y, Span xs, FloatLanes& farthest) {
    const size_t inPitch = job_.features.pitch(), outPitch = pitch_;
    const float* in = job_.features.row(first, y) + xs.begin;
    const float* root = root_.data();
    float* out = row(first + 1) + filled_;
    std::array<float, N> centre;
    std::copy_n(centre_.begin() + first, N, centre.begin());
    FloatLanes largest = farthest;
    for (int x = 0; x < xs.length(); x += kLanes) {
      const FloatLanes scale = loadLanes(root + x);
      FloatLanes distance{};
      for (size_t k = 0; k < N; ++k) {
        const FloatLanes d = loadLanes(in + k * inPitch + x) - centre[k];
        distance += d * d;
        storeLanes(out + k * outPitch + x, scale * d);
      }
      if (xs.length() - x < kLanes)  // lanes past the end of the row
        distance = laneIndices() < static_cast<float>(xs.length() - x) ? distance : FloatLanes{};
      largest = maxLanes(largest, distance);
    }
    farthest = largest;
  }

  void appendTargets(int y, int x, int inRow, FloatLanes root) {
    const bool shared = weights_.size() > 1;
    const FloatLanes inverse = shared ? (root > 0.0f ? 1.0f / root : FloatLanes{}) : FloatLanes{};
    const float* target = job_.targets.row(0, y) + x;
    const auto colours = static_cast<size_t>(job_.colours);
    std::array<FloatLanes, NormalEquations::kMaxColours> rhs{};
    for (const std::vector<float>& weights : weights_) {
      const FloatLanes scale = shared ? loadLanes(&weights[static_cast<size_t>(inRow)]) * inverse : root;
      for (size_t c = 0; c < colours; ++c, target += job_.targets.pitch()) rhs[c] += scale * loadLanes(target);
    }
    for (size_t c = 0; c < colours; ++c) storeLanes(row(rhsRow() + static_cast<int>(c)) + filled_ + inRow, rhs[c]);
  }

  // Adds the products of the chunk's rows to the sums.
  void flush() {
    for (int r = 0; r < rhsRow() + job_.colours; ++r) std::fill_n(row(r) + filled_, kLanes, 0.0f);
    FloatLanes* sums = sums_.data();
    for (int i = 0; i < rowBlocks(); ++i)
      for (int j = 0; j < std::min(i + 1, blocks_); ++j, sums += kRegisterBlock * kRegisterBlock)
        multiply(row(i * kRegisterBlock), row(j * kRegisterBlock), sums);
    filled_ = 0;
  }

  void multiply(const float* left, const float* right, FloatLanes* sums) const {
    const float *l0 = left, *l1 = left + pitch_, *l2 = left + 2 * pitch_;
    const float *r0 = right, *r1 = right + pitch_, *r2 = right + 2 * pitch_;
    FloatLanes s00 = sums[0], s01 = sums[1], s02 = sums[2], s10 = sums[3], s11 = sums[4], s12 = sums[5];
    FloatLanes s20 = sums[6], s21 = sums[7], s22 = sums[8];
    for (int n = 0; n < filled_; n += kLanes) {
      const FloatLanes b0 = loadLanes(r0 + n), b1 = loadLanes(r1 + n), b2 = loadLanes(r2 + n);
      const FloatLanes a0 = loadLanes(l0 + n), a1 = loadLanes(l1 + n), a2 = loadLanes(l2 + n);
      s00 += a0 * b0, s01 += a0 * b1, s02 += a0 * b2;
      s10 += a1 * b0, s11 += a1 * b1, s12 += a1 * b2;
      s20 += a2 * b0, s21 += a2 * b1, s22 += a2 * b2;
    }
    sums[0] = s00, sums[1] = s01, sums[2] = s02, sums[3] = s10, sums[4] = s11, sums[5] = s12;
    sums[6] = s20, sums[7] = s21, sums[8] = s22;
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
  std::vector<float> root_;
  std::vector<std::vector<float>> weights_;  // of every term
  std::array<float, RegressionInputs::kMaxFeatures> centre_{};
  static constexpr size_t kMaxColourBlocks = NormalEquations::kMaxColours / kRegisterBlock;
  std::array<FloatLanes, kMaxBlocks*(kMaxBlocks + 1 + 2 * kMaxColourBlocks) / 2 * kRegisterBlock * kRegisterBlock>
      sums_;
  std::array<FloatLanes, RegressionInputs::kMaxFeatures> farthest_;
};

}  // namespace braid::regression
