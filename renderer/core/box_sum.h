// SPDX-License-Identifier: Apache-2.0
// Sums over square windows in constant time a pixel, without subtractions: sums of non-negative values are exact zeros
// or positive.
//
// Rows are summed along x as they come and at once along y, a few blocks of rows at a time: all that is kept of them
// stays in the cache. Blocks have as many rows as a window; a window is the tail of one block plus the head of the next
// (van Herk 1992, with sums in place of maxima), so two running sums that never forget are enough.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/core/vectorised.h"
#include "renderer/core/window_sums.h"

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

// The sums, of this type, of one image for consecutive rows, from the first to the last of its blocks.
template <class T, class Sum>
class BoxSummer {
 public:
  BoxSummer(const Plane<T>& in, int radius, WindowBorder border)
      : in_(in),
        radius_(radius),
        length_(2 * radius + 1),
        before_(border == WindowBorder::Mirrored ? radius : 0),
        width_(in.width),
        line_(static_cast<size_t>(in.width + 2 * radius)),
        spare_(line_.size()),
        rows_(static_cast<size_t>(length_ * in.width)),
        tails_(rows_.size()),
        heads_(static_cast<size_t>(in.width)) {}

  // Blocks of rows that hold a window's last row.
  static int blocks(int height, int radius, WindowBorder border) {
    return (height + radius + (border == WindowBorder::Mirrored ? radius : 0) + 2 * radius) / (2 * radius + 1);
  }

  // Block b holds the rows from b (2 radius + 1) - before on. The windows that end in it are those of out's rows.
  // finish(sum, x, y) is what becomes of the sum around a pixel.
  template <class Finish>
  void sum(int firstBlock, int lastBlock, const Finish& finish, Plane<Sum>& out) {
    std::fill(tails_.begin(), tails_.end(), Sum(0));
    if (firstBlock > 0) {
      load(firstBlock - 1);
      makeTails();
    }
    for (int b = firstBlock; b < lastBlock; ++b) {
      load(b);
      addHeads(b, finish, out);
      makeTails();
    }
  }

 private:
  Sum* row(std::vector<Sum>& of, int j) { return of.data() + static_cast<ptrdiff_t>(j) * width_; }

  // The sums along x of the rows of a block.
  void load(int block) {
    for (int j = 0; j < length_; ++j) {
      const int y = block * length_ + j - before_;
      if (before_ > 0 && y < in_.height + radius_)
        sumLine(mirrorIndex(y, in_.height), row(rows_, j));
      else if (before_ == 0 && y < in_.height)
        sumLine(y, row(rows_, j));
      else
        std::fill_n(row(rows_, j), width_, Sum(0));
    }
  }

  void sumLine(int y, Sum* out) {
    const T* from = in_.data.data() + in_.index(0, y);
    Sum* line = line_.data();
    for (int x = 0; x < radius_; ++x) {
      line[x] = before_ > 0 ? static_cast<Sum>(from[mirrorIndex(x - radius_, width_)]) : Sum(0);
      line[radius_ + width_ + x] = before_ > 0 ? static_cast<Sum>(from[mirrorIndex(width_ + x, width_)]) : Sum(0);
    }
    for (int x = 0; x < width_; ++x) line[radius_ + x] = static_cast<Sum>(from[x]);
    windowSums(line, spare_.data(), width_, length_, out);
  }

  // tails_[j]: the sum of rows j and up of the block; row 0 is never asked for, as the whole block is all head then.
  void makeTails() {
    for (int j = length_ - 1; j > 0; --j) {
      const Sum *in = row(rows_, j), *next = j + 1 < length_ ? row(tails_, j + 1) : nullptr;
      Sum* tail = row(tails_, j);
      if (next)
        for (int x = 0; x < width_; ++x) tail[x] = in[x] + next[x];
      else
        std::copy_n(in, width_, tail);
    }
  }

  template <class Finish>
  void addHeads(int block, const Finish& finish, Plane<Sum>& out) {
    std::fill(heads_.begin(), heads_.end(), Sum(0));
    for (int j = 0; j < length_; ++j) {
      const Sum* in = row(rows_, j);
      for (int x = 0; x < width_; ++x) heads_[static_cast<size_t>(x)] += in[x];
      const int y = block * length_ + j - before_ - radius_;
      if (y < 0 || y >= in_.height) continue;
      Sum* to = out.data.data() + out.index(0, y);
      const Sum *tail = j + 1 < length_ ? row(tails_, j + 1) : nullptr, *head = heads_.data();
      if (tail)
        for (int x = 0; x < width_; ++x) to[x] = static_cast<Sum>(finish(tail[x] + head[x], x, y));
      else
        for (int x = 0; x < width_; ++x) to[x] = static_cast<Sum>(finish(head[x], x, y));
    }
  }

  const Plane<T>& in_;
  const int radius_, length_, before_, width_;
  std::vector<Sum> line_, spare_;          // of a row and what its windows hold beside it
  std::vector<Sum> rows_, tails_, heads_;  // of a block of rows
};

}  // namespace box_sum_detail

// finish(sum, x, y) for the sums over the windows of (2 radius + 1)² pixels around all (x, y), added in the type of
// the result. The same bits for any number of threads.
template <class Out, class T, class Finish>
Plane<Out> finishedBoxSum(const Plane<T>& in, int radius, WindowBorder border, const Finish& finish) {
  Plane<Out> out(in.width, in.height, kUnfilled);
  if (in.empty()) return out;
  const int blocks = box_sum_detail::BoxSummer<T, Out>::blocks(in.height, radius, border),
            together = std::max(1, 64 / (2 * radius + 1));
  parallelChunks(static_cast<size_t>(blocks), static_cast<size_t>(together), [&](size_t begin, size_t end) {
    box_sum_detail::BoxSummer<T, Out> summer(in, radius, border);
    runVectorised([&] { summer.sum(static_cast<int>(begin), static_cast<int>(end), finish, out); });
  });
  return out;
}

// The sums, times `scale`.
template <class Out = double, class T>
Plane<Out> boxSum(const Plane<T>& in, int radius, WindowBorder border = WindowBorder::Clamped, double scale = 1) {
  return finishedBoxSum<Out>(in, radius, border, [scale](double sum, int /*x*/, int /*y*/) { return sum * scale; });
}

}  // namespace braid
