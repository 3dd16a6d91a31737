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

  // Adds a row of the window to the chunk.
  void append(int cx, int cy, int y, Span xs) {
    for (size_t t = 0; t < weights_.size(); ++t)
      job_.inputs.terms[t].weights->row(cx, cy, y, xs.begin, xs.end, weights_[t].data());
    if (job_.colours == 3)
      weights_.size() == 1 ? appendRow<3, false>(y, xs) : appendRow<3, true>(y, xs);
    else
      weights_.size() == 1 ? appendRow<6, false>(y, xs) : appendRow<6, true>(y, xs);
  }

  // The same, from its weights, for all rows of the design matrix at once: loops over a few vectors each would wait for
  // their ends. Lanes past the end of the row are zero.
  template <size_t kColours, bool kShared>
  void appendRow(int y, Span xs) {
    const int planes = job_.features.planes();
    const float* features = planes > 0 ? job_.features.row(0, y) + xs.begin : weights_[0].data();  // else not read
    const float* targets = job_.targets.row(0, y) + xs.begin;
    prefetch(job_.features, features, xs.length());
    prefetch(job_.targets, targets, xs.length());
    for (int x = 0; x < xs.length(); x += kLanes) {
      const IntLanes inside = laneIndices() < static_cast<float>(xs.length() - x);
      FloatLanes weight = loadLanes(&weights_[0][static_cast<size_t>(x)]);
      for (size_t t = 1; kShared && t < weights_.size(); ++t) weight += loadLanes(&weights_[t][static_cast<size_t>(x)]);
      weight = inside ? weight : FloatLanes{};
      if (!anyLane(weight >= kLeastWeight)) {
        appendFeatures<false>(features + x, FloatLanes{}, inside, nullptr);
        continue;
      }
      const FloatLanes root = sqrtLanes(weight);
      float* out = row(0) + filled_;
      storeLanes(out, root);
      appendFeatures<true>(features + x, root, inside, out + pitch_);
      appendTargets<kColours, kShared>(targets + x, x, root, row(rhsRow()) + filled_);
      filled_ += std::min(kLanes, xs.length() - x);
    }
  }

  // What the window of the next centre reads beyond this one: hundreds of rows are too many for the processor to
  // foresee (a regression takes 1.13x as long without).
  static void prefetch(const PackedRows& planes, const float* row, int length) {
    for (int k = 0; k < planes.planes(); ++k, row += planes.pitch()) __builtin_prefetch(row + length + kLanes);
  }

  // The largest squared distance in every group so far, and rows sqrt(w) (f - f_c).
  template <bool kStore>
  void appendFeatures(const float* in, FloatLanes root, IntLanes inside, float* out) {
    const size_t inPitch = job_.features.pitch(), outPitch = pitch_, groups = job_.groupEnd.size();
    const int* groupEnd = job_.groupEnd.data();
    int k = 0;
    for (size_t g = 0; g < groups; ++g) {
      FloatLanes distance{};
      for (const int end = groupEnd[g]; k < end; ++k, in += inPitch) {
        const FloatLanes d = loadLanes(in) - centre_[static_cast<size_t>(k)];
        distance += d * d;
        if constexpr (kStore) storeLanes(out, root * d), out += outPitch;
      }
      farthest_[g] = maxLanes(farthest_[g], inside ? distance : FloatLanes{});
    }
  }

  // Rows sqrt(w) x; with several terms Σ_t w_t x_t / sqrt(w).
  template <size_t kColours, bool kShared>
  void appendTargets(const float* target, int x, FloatLanes root, float* out) const {
    const size_t pitch = job_.targets.pitch();
    std::array<FloatLanes, kColours> rhs{};
    if constexpr (kShared) {
      const FloatLanes inverse = root > 0.0f ? 1.0f / root : FloatLanes{};
      for (const std::vector<float>& weights : weights_) {
        const FloatLanes scale = loadLanes(&weights[static_cast<size_t>(x)]) * inverse;
        for (size_t c = 0; c < kColours; ++c, target += pitch) rhs[c] += scale * loadLanes(target);
      }
    } else {
      for (size_t c = 0; c < kColours; ++c) rhs[c] = root * loadLanes(target + c * pitch);
    }
    const size_t outPitch = pitch_;
    for (size_t c = 0; c < kColours; ++c) storeLanes(out + c * outPitch, rhs[c]);
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
      FloatLanes b0 = loadLanes(r0 + n), b1 = loadLanes(r1 + n), b2 = loadLanes(r2 + n), a = loadLanes(l0 + n);
      for (FloatLanes* v : {&b0, &b1, &b2, &a}) keepInRegister(*v);
      s00 += a * b0, s01 += a * b1, s02 += a * b2;
      keepInRegister(a = loadLanes(l1 + n));
      s10 += a * b0, s11 += a * b1, s12 += a * b2;
      keepInRegister(a = loadLanes(l2 + n));
      s20 += a * b0, s21 += a * b1, s22 += a * b2;
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
  std::vector<std::vector<float>> weights_;  // of every term
  std::array<float, RegressionInputs::kMaxFeatures> centre_{};
  static constexpr size_t kMaxColourBlocks = NormalEquations::kMaxColours / kRegisterBlock;
  std::array<FloatLanes, kMaxBlocks*(kMaxBlocks + 1 + 2 * kMaxColourBlocks) / 2 * kRegisterBlock * kRegisterBlock>
      sums_;
  std::array<FloatLanes, RegressionInputs::kMaxFeatures> farthest_;
};

}  // namespace braid::regression
