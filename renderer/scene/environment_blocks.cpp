// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/environment_blocks.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

// Of the probability, what does not ask for the normal: nothing that arrives may be impossible to draw.
constexpr double kRegardless = 0.05;
constexpr int kPointsPerAxis = 4;  // of the mean cosine over a block

Vec3 directionTo(float column, float row, int width, int height) {
  const float theta = kPi * row / static_cast<float>(height);
  const float phi = 2 * kPi * (column / static_cast<float>(width) - 0.5f);
  return {std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)};
}

}  // namespace

void EnvironmentBlocks::build(const TexelDistribution& of) {
  width_ = of.width;
  height_ = of.height;
  columns_ = std::min(kMostColumns, width_);
  rows_ = std::min(kMostRows, height_);
  sumRows(of);
  const std::vector<Vec3> points = pointsOfBlocks();
  tables_.assign(static_cast<size_t>(kNormalColumns * kNormalRows) * tableSize(), 0.0f);
  parallelFor(static_cast<size_t>(kNormalColumns * kNormalRows), [&](size_t n) {
    const Vec3 normal = directionTo(static_cast<float>(n % kNormalColumns), static_cast<float>(n / kNormalColumns),
                                    kNormalColumns, kNormalRows - 1);
    fillTable(normal, points, &tables_[n * tableSize()]);
  });
}

void EnvironmentBlocks::sumRows(const TexelDistribution& of) {
  share_.assign(static_cast<size_t>(columns_ * rows_), 0.0f);
  rowsInBlock_.assign(static_cast<size_t>(columns_) * static_cast<size_t>(height_ + rows_), 0.0f);
  std::vector<double> sums;
  size_t next = 0;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      sums.assign(1, 0.0);
      for (int y = rowBegin(row); y < rowBegin(row + 1); ++y) {
        const float* cdf = &of.conditional[static_cast<size_t>(y) * static_cast<size_t>(width_ + 1)];
        const auto part = static_cast<double>(cdf[columnBegin(column + 1)] - cdf[columnBegin(column)]);
        sums.push_back(sums.back() + part * static_cast<double>(of.marginal[static_cast<size_t>(y) + 1] -
                                                                of.marginal[static_cast<size_t>(y)]));
      }
      const double total = sums.back();
      share_[static_cast<size_t>(row * columns_ + column)] = static_cast<float>(total);
      for (const double s : sums) rowsInBlock_[next++] = static_cast<float>(total > 0 ? s / total : 0);
    }
}

// kPointsPerAxis² directions of each block.
std::vector<Vec3> EnvironmentBlocks::pointsOfBlocks() const {
  const auto inside = [](int begin, int end, int k) {
    return static_cast<float>(begin) +
           static_cast<float>(end - begin) * (static_cast<float>(k) + 0.5f) / kPointsPerAxis;
  };
  std::vector<Vec3> points;
  points.reserve(share_.size() * kPointsPerAxis * kPointsPerAxis);
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column)
      for (int k = 0; k < kPointsPerAxis * kPointsPerAxis; ++k)
        points.push_back(directionTo(inside(columnBegin(column), columnBegin(column + 1), k % kPointsPerAxis),
                                     inside(rowBegin(row), rowBegin(row + 1), k / kPointsPerAxis), width_, height_));
  return points;
}

void EnvironmentBlocks::fillTable(const Vec3& normal, const std::vector<Vec3>& points, float* table) const {
  std::vector<double> lit(share_.size());
  double all = 0, litSum = 0;
  for (size_t b = 0; b < share_.size(); ++b) {
    double cosine = 0;
    for (size_t k = 0; k < kPointsPerAxis * kPointsPerAxis; ++k)
      cosine += static_cast<double>(std::max(glm::dot(points[b * kPointsPerAxis * kPointsPerAxis + k], normal), 0.0f));
    lit[b] = static_cast<double>(share_[b]) * cosine;
    all += static_cast<double>(share_[b]);
    litSum += lit[b];
  }
  double above = 0;
  for (int row = 0; row < rows_; ++row) {
    double left = 0;
    for (int column = 0; column < columns_; ++column) {
      const auto b = static_cast<size_t>(row * columns_ + column);
      const double regardless = all > 0 ? static_cast<double>(share_[b]) / all : 0;
      left += litSum > 0 ? (1 - kRegardless) * lit[b] / litSum + kRegardless * regardless : regardless;
      table[leftOf(column + 1, row)] = static_cast<float>(left);
    }
    above += left;
    table[aboveRow(row + 1)] = static_cast<float>(above);
  }
}

EnvironmentBlocks::Mixture EnvironmentBlocks::mixtureOf(const Vec3& n) const {
  // In this order, for max() makes 0 of what is no number.
  const float row = std::max(0.0f, std::acos(std::clamp(n.y, -1.0f, 1.0f)) * kInvPi * (kNormalRows - 1));
  const float column = std::max(0.0f, (std::atan2(n.z, n.x) * 0.5f * kInvPi + 0.5f) * kNormalColumns);
  const int row0 = std::min(static_cast<int>(row), kNormalRows - 2), column0 = static_cast<int>(column);
  const float fy = row - static_cast<float>(row0), fx = column - static_cast<float>(column0);
  Mixture m;
  for (int k = 0; k < 4; ++k) {
    const int x = (column0 + k % 2) % kNormalColumns, y = row0 + k / 2;
    m.table[static_cast<size_t>(k)] = static_cast<size_t>(y * kNormalColumns + x) * tableSize();
    m.weight[static_cast<size_t>(k)] = (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
  }
  return m;
}

float EnvironmentBlocks::sample(const TexelDistribution& of, const Vec3& normal, Vec2 u, Vec2& position) const {
  const Mixture m = mixtureOf(normal);
  u.y *= at(m, aboveRow(rows_));
  const int row = findStep([&](int r) { return at(m, aboveRow(r)); }, rows_, u.y);
  u.x *= at(m, leftOf(columns_, row));
  const int column = findStep([&](int c) { return at(m, leftOf(c, row)); }, columns_, u.x);
  const auto block = static_cast<size_t>(row * columns_ + column);
  if (!(share_[block] > 0)) return 0;
  // The blocks above have all of their rows and one entry more each; so have those to the left.
  const size_t first = static_cast<size_t>(columns_) * static_cast<size_t>(rowBegin(row) + row) +
                       static_cast<size_t>(column) * static_cast<size_t>(rowBegin(row + 1) - rowBegin(row) + 1);
  const int y = rowBegin(row) + findStep([&](int k) { return rowsInBlock_[first + static_cast<size_t>(k)]; },
                                         rowBegin(row + 1) - rowBegin(row), u.y);
  const float* cdf = &of.conditional[static_cast<size_t>(y) * static_cast<size_t>(width_ + 1)];
  const int begin = columnBegin(column), end = columnBegin(column + 1);
  // Differences first: of a small share of the row little else would be left.
  u.x *= cdf[end] - cdf[begin];
  const int x = begin + findStep([&](int k) { return cdf[begin + k] - cdf[begin]; }, end - begin, u.x);
  position = Vec2(withinTexel(static_cast<size_t>(x), u.x), withinTexel(static_cast<size_t>(y), u.y));
  return (at(m, leftOf(column + 1, row)) - at(m, leftOf(column, row))) / share_[block];
}

float EnvironmentBlocks::ratio(const Vec3& normal, int x, int y) const {
  // The inverse of columnBegin() and rowBegin().
  const int column = static_cast<int>(((int64_t(x) + 1) * columns_ - 1) / width_);
  const int row = static_cast<int>(((int64_t(y) + 1) * rows_ - 1) / height_);
  const float share = share_[static_cast<size_t>(row * columns_ + column)];
  if (!(share > 0)) return 0;
  const Mixture m = mixtureOf(normal);
  return (at(m, leftOf(column + 1, row)) - at(m, leftOf(column, row))) / share;
}

}  // namespace braid
