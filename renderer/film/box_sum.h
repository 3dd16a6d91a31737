// SPDX-License-Identifier: Apache-2.0
// Sums over square windows in constant time a pixel, without subtractions: sums of non-negative values are exact zeros
// or positive.
//
// A line is cut into blocks as long as a window; a window is the tail of one block plus the head of the next (van Herk
// 1992, with sums in place of maxima), so two running sums that never forget are enough. Lines are summed along x as
// they come and at once along y, a few blocks of rows at a time: all that is kept of them stays in the cache.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

// i for 0 <= i < size; -i below, 2 size - 2 - i above, again and again for images smaller than the window.
inline int mirrorIndex(int i, int size) {
  if (size == 1) return 0;
  const int period = 2 * (size - 1);
  const int m = ((i % period) + period) % period;
  return m < size ? m : period - m;
}

// What windows hold beyond the borders of an image: nothing, or its mirror image without the edge repeated.
enum class WindowBorder { Clamped, Mirrored };

namespace box_sum_detail {

// The sums of one image for consecutive rows, from the first to the last of its blocks.
template <class T>
class BoxSummer {
 public:
  BoxSummer(const Plane<T>& in, int radius, WindowBorder border)
      : in_(in),
        radius_(radius),
        length_(2 * radius + 1),
        before_(border == WindowBorder::Mirrored ? radius : 0),
        width_(in.width),
        line_(roundedUp(in.width + 2 * before_ + radius)),
        head_(line_.size()),
        tail_(line_.size() + static_cast<size_t>(length_)),
        rows_(static_cast<size_t>(length_ * in.width)),
        tails_(rows_.size()),
        heads_(static_cast<size_t>(in.width)) {}

  // Blocks of rows that hold a window's last row.
  static int blocks(int height, int radius, WindowBorder border) {
    return (height + radius + (border == WindowBorder::Mirrored ? radius : 0) + 2 * radius) / (2 * radius + 1);
  }

  // Block b holds the rows from b (2 radius + 1) - before on. The windows that end in it are those of out's rows.
  void sum(int firstBlock, int lastBlock, double scale, Plane<double>& out) {
    std::fill(tails_.begin(), tails_.end(), 0.0);
    if (firstBlock > 0) {
      load(firstBlock - 1);
      makeTails();
    }
    for (int b = firstBlock; b < lastBlock; ++b) {
      load(b);
      addHeads(b, scale, out);
      makeTails();
    }
  }

 private:
  size_t roundedUp(int count) const { return static_cast<size_t>((count + length_ - 1) / length_ * length_); }
  double* row(std::vector<double>& of, int j) { return of.data() + static_cast<ptrdiff_t>(j) * width_; }

  // The sums along x of the rows of a block.
  void load(int block) {
    for (int j = 0; j < length_; ++j) {
      const int y = block * length_ + j - before_;
      if (before_ > 0 && y < in_.height + radius_)
        sumLine(mirrorIndex(y, in_.height), row(rows_, j));
      else if (before_ == 0 && y < in_.height)
        sumLine(y, row(rows_, j));
      else
        std::fill_n(row(rows_, j), width_, 0.0);
    }
  }

  void sumLine(int y, double* out) {
    const T* from = in_.data.data() + in_.index(0, y);
    for (int x = 0; x < before_; ++x) {
      line_[static_cast<size_t>(x)] = static_cast<double>(from[mirrorIndex(x - before_, width_)]);
      line_[static_cast<size_t>(before_ + width_ + x)] = static_cast<double>(from[mirrorIndex(width_ + x, width_)]);
    }
    for (int x = 0; x < width_; ++x) line_[static_cast<size_t>(before_ + x)] = static_cast<double>(from[x]);
    const auto length = static_cast<size_t>(length_);
    for (size_t begin = 0; begin < line_.size(); begin += length) {
      double head = 0, tail = 0;
      for (size_t i = 0; i < length; ++i) {
        head_[begin + i] = head += line_[begin + i];
        tail_[begin + length - 1 - i] = tail += line_[begin + length - 1 - i];
      }
    }
    // The window of x begins at first, of which the tail is empty where it is a whole block.
    const int shift = before_ - radius_;
    for (size_t begin = 0; begin < line_.size(); begin += length) tail_[begin] = 0;
    for (int x = 0; x < width_; ++x) {
      const int first = x + shift;
      out[x] = (first < 0 ? 0.0 : tail_[static_cast<size_t>(first)]) + head_[static_cast<size_t>(first + length_ - 1)];
    }
  }

  // tails_[j]: the sum of rows j and up of the block; row 0 is never asked for, as the whole block is all head then.
  void makeTails() {
    for (int j = length_ - 1; j > 0; --j) {
      const double *in = row(rows_, j), *next = j + 1 < length_ ? row(tails_, j + 1) : nullptr;
      double* tail = row(tails_, j);
      if (next)
        for (int x = 0; x < width_; ++x) tail[x] = in[x] + next[x];
      else
        std::copy_n(in, width_, tail);
    }
  }

  void addHeads(int block, double scale, Plane<double>& out) {
    std::fill(heads_.begin(), heads_.end(), 0.0);
    for (int j = 0; j < length_; ++j) {
      const double* in = row(rows_, j);
      for (int x = 0; x < width_; ++x) heads_[static_cast<size_t>(x)] += in[x];
      const int y = block * length_ + j - before_ - radius_;
      if (y < 0 || y >= in_.height) continue;
      double* to = out.data.data() + out.index(0, y);
      if (j + 1 < length_) {
        const double* tail = row(tails_, j + 1);
        for (int x = 0; x < width_; ++x) to[x] = (tail[x] + heads_[static_cast<size_t>(x)]) * scale;
      } else {
        for (int x = 0; x < width_; ++x) to[x] = heads_[static_cast<size_t>(x)] * scale;
      }
    }
  }

  const Plane<T>& in_;
  const int radius_, length_, before_, width_;
  std::vector<double> line_, head_, tail_;    // of a row, in whole blocks
  std::vector<double> rows_, tails_, heads_;  // of a block of rows
};

}  // namespace box_sum_detail

// Sums over windows of (2 radius + 1)² pixels, times `scale`. The same bits for any number of threads.
template <class T>
Plane<double> boxSum(const Plane<T>& in, int radius, WindowBorder border = WindowBorder::Clamped, double scale = 1) {
  Plane<double> out(in.width, in.height, kUnfilled);
  if (in.empty()) return out;
  const int blocks = box_sum_detail::BoxSummer<T>::blocks(in.height, radius, border),
            together = std::max(1, 64 / (2 * radius + 1));
  parallelChunks(static_cast<size_t>(blocks), static_cast<size_t>(together), [&](size_t begin, size_t end) {
    box_sum_detail::BoxSummer<T>(in, radius, border).sum(static_cast<int>(begin), static_cast<int>(end), scale, out);
  });
  return out;
}

}  // namespace braid
