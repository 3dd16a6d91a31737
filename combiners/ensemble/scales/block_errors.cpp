// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/scales/block_errors.h"

#include <algorithm>

#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/window.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// One row of blocks.
class BlockRow {
 public:
  BlockRow(const Estimate& x, const std::vector<const Estimate*>& candidates, const Plane<float>& roots, int half)
      : x_(x),
        candidates_(candidates),
        roots_(roots),
        half_(half),
        width_(static_cast<size_t>(x.mean.width())),
        boxed_(3 * candidates.size() * width_) {
    for (std::vector<float>& row : rows_) row.resize(boxed_.size());
  }
  void write(int row, std::vector<Plane<float>>& out);

 private:
  void errorsOfRow(int y, std::vector<float>& out) const;
  void boxOfRows(const std::vector<float>& above, const std::vector<float>& here);
  void addProducts(int columns);

  const Estimate& x_;
  const std::vector<const Estimate*>& candidates_;
  const Plane<float>& roots_;
  int half_;
  size_t width_;
  std::vector<float> rows_[2];  // errors of two rows of pixels, by candidate, channel and column
  std::vector<float> boxed_;    // their means over 2x2 pixels
  std::vector<double> sums_;    // by pair and block
};

// The errors of row y, that of the border for a row above it.
void BlockRow::errorsOfRow(int y, std::vector<float>& out) const {
  const size_t at = roots_.index(0, std::max(0, y));
  const float* __restrict root = &roots_[at];
  float* __restrict to = out.data();
  for (const Estimate* candidate : candidates_)
    for (size_t c = 0; c < 3; ++c, to += width_) {
      const float* __restrict y0 = &candidate->half[half_][c][at];
      const float* __restrict x0 = &x_.half[1 - half_][c][at];
      for (size_t i = 0; i < width_; ++i) to[i] = (y0[i] - x0[i]) * root[i];
    }
}

void BlockRow::boxOfRows(const std::vector<float>& above, const std::vector<float>& here) {
  for (size_t row = 0; row < boxed_.size(); row += width_) {
    const float* __restrict a = &above[row], * __restrict b = &here[row];
    float* __restrict out = &boxed_[row];
    out[0] = 0.5f * (a[0] + b[0]);
    for (size_t i = 1; i < width_; ++i) out[i] = 0.25f * ((a[i - 1] + a[i]) + (b[i - 1] + b[i]));
  }
}

void BlockRow::addProducts(int columns) {
  const size_t ofCandidate = 3 * width_;
  double* sum = sums_.data();
  for (size_t i = 0; i < candidates_.size(); ++i)
    for (size_t j = 0; j <= i; ++j, sum += columns) {
      const float *p = &boxed_[i * ofCandidate], *q = &boxed_[j * ofCandidate];
      for (size_t c = 0; c < 3; ++c, p += width_, q += width_)
        for (size_t k = 0; k < width_; ++k)
          sum[k / kErrorBlock] += static_cast<double>(p[k]) * static_cast<double>(q[k]);
    }
}

void BlockRow::write(int row, std::vector<Plane<float>>& out) {
  const int columns = out[0].width, first = row * kErrorBlock;
  const int last = std::min(x_.mean.height(), first + kErrorBlock);
  sums_.assign(out.size() * static_cast<size_t>(columns), 0.0);
  errorsOfRow(first - 1, rows_[0]);
  for (int y = first; y < last; ++y) {
    const auto parity = static_cast<size_t>(y - first) % 2;
    errorsOfRow(y, rows_[1 - parity]);
    boxOfRows(rows_[parity], rows_[1 - parity]);
    addProducts(columns);
  }
  const double* sum = sums_.data();
  for (Plane<float>& plane : out)
    for (int b = 0; b < columns; ++b) {
      const int pixels = (last - first) * std::min(kErrorBlock, x_.mean.width() - b * kErrorBlock);
      plane.at(b, row) = finiteFloat(*sum++ / pixels);
    }
}

}  // namespace

std::vector<Plane<float>> blockErrors(const Estimate& x, const std::vector<const Estimate*>& candidates,
                                      const Plane<float>& roots, int half) {
  const int columns = (x.mean.width() + kErrorBlock - 1) / kErrorBlock;
  const int rows = (x.mean.height() + kErrorBlock - 1) / kErrorBlock;
  std::vector<Plane<float>> out(pairIndex(candidates.size(), 0), Plane<float>(columns, rows, kUnfilled));
  parallelRows(rows, [&](int row) {
    BlockRow blocks(x, candidates, roots, half);
    runVectorised([&] { blocks.write(row, out); });
  });
  return out;
}

}  // namespace braid
