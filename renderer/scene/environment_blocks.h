// SPDX-License-Identifier: Apache-2.0
// What of an environment lights a surface: its texels in blocks, and for each of a grid of normals the probability of a
// block, by its radiance times the mean cosine there. A surface that faces away from a bright spot draws it seldom.
// Between the normals of the grid probabilities are interpolated, so that densities have no steps.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// The distribution of a latitude-longitude image that knows no surface: the rows by `marginal` (height + 1 values from
// 0 to 1), the texels of row y by `conditional` (width + 1 values from y · (width + 1) on).
struct TexelDistribution {
  const std::vector<float>& conditional;
  const std::vector<float>& marginal;
  int width = 0, height = 0;
};

// The index i in [0, count) with f(i) <= u < f(i + 1) of an increasing f, and where between the two u is.
template <class F>
int findStep(const F& f, int count, float& u) {
  int low = 0, high = count;
  float below = f(0), above = f(count);
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    const float value = f(middle);
    (value <= u ? low : high) = middle;
    (value <= u ? below : above) = value;
  }
  u = above > below ? std::clamp((u - below) / (above - below), 0.0f, kOneMinusEpsilon) : 0.5f;
  return low;
}

// i + fraction, and below i + 1 where floats are too coarse for the sum: a place stays in its texel.
inline float withinTexel(size_t i, float fraction) {
  return std::min(static_cast<float>(i) + fraction, static_cast<float>(i + 1) * kOneMinusEpsilon);
}

class EnvironmentBlocks {
 public:
  void build(const TexelDistribution& of);
  bool empty() const { return share_.empty(); }

  // A texel for a surface with this normal (unit, in the directions of the image), and where in it: columns and rows
  // from the upper left corner. Returns its probability over that which `of` gives it, 0 where there is none.
  float sample(const TexelDistribution& of, const Vec3& normal, Vec2 u, Vec2& position) const;
  // The same ratio for a texel.
  float ratio(const Vec3& normal, int x, int y) const;

  size_t bytes() const { return (tables_.size() + share_.size() + rowsInBlock_.size()) * sizeof(float); }

 private:
  static constexpr int kMostColumns = 32, kMostRows = 16;      // of blocks
  static constexpr int kNormalColumns = 24, kNormalRows = 13;  // from pole to pole

  // The four normals of the grid around one, as offsets of their tables, and their weights.
  struct Mixture {
    std::array<size_t, 4> table;
    std::array<float, 4> weight;
  };
  Mixture mixtureOf(const Vec3& normal) const;
  float at(const Mixture& m, size_t entry) const {
    float sum = 0;
    for (size_t k = 0; k < 4; ++k) sum += m.weight[k] * tables_[m.table[k] + entry];
    return sum;
  }
  // Entries of a table: probabilities summed over the rows of blocks above one, and within a row over those left of it.
  size_t aboveRow(int row) const { return static_cast<size_t>(row); }
  size_t leftOf(int column, int row) const { return static_cast<size_t>(rows_ + 1 + row * (columns_ + 1) + column); }
  size_t tableSize() const { return leftOf(0, rows_); }
  int columnBegin(int column) const { return static_cast<int>(int64_t(column) * width_ / columns_); }
  int rowBegin(int row) const { return static_cast<int>(int64_t(row) * height_ / rows_); }
  std::vector<Vec3> pointsOfBlocks() const;
  void fillTable(const Vec3& normal, const std::vector<Vec3>& points, float* table) const;
  void sumRows(const TexelDistribution& of);

  int width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
  std::vector<float> share_;        // of each block, without a surface
  std::vector<float> rowsInBlock_;  // per block: its rows' shares of it, summed from 0 to 1
  std::vector<float> tables_;       // one a normal
};

}  // namespace braid
