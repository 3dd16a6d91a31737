// SPDX-License-Identifier: Apache-2.0
// Copies of several planes, laid out row by row: the rows of all planes at one height lie next to each other, so that
// a window touches few pages, and every row ends in zeros, so that vector loads may run over its end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"

namespace braid {

class PackedRows {
 public:
  static constexpr int kSlack = 16;  // zeros after every row

  PackedRows() = default;
  explicit PackedRows(const std::vector<const Plane<float>*>& planes) : planes_(planes.size()) {
    if (planes.empty()) return;
    const auto width = static_cast<size_t>(planes[0]->width), height = static_cast<size_t>(planes[0]->height);
    pitch_ = (width + 15) / 16 * 16 + kSlack;
    if (pitch_ % 1024 == 0) pitch_ += 16;  // rows 4 KiB apart would share one set of the cache
    data_.assign(pitch_ * planes_ * height, 0.0f);
    parallelRows(planes[0]->height, [&](int y) {
      for (size_t k = 0; k < planes_; ++k) {
        const float* in = planes[k]->data.data() + static_cast<size_t>(y) * width;
        std::copy(in, in + width, data_.data() + offset(k, y));
      }
    });
  }

  int planes() const { return static_cast<int>(planes_); }
  // Distance of the rows of two consecutive planes.
  size_t pitch() const { return pitch_; }
  const float* row(int plane, int y) const { return data_.data() + offset(static_cast<size_t>(plane), y); }

 private:
  size_t offset(size_t plane, int y) const { return (static_cast<size_t>(y) * planes_ + plane) * pitch_; }

  size_t planes_ = 0, pitch_ = 0;
  std::vector<float> data_;
};

}  // namespace braid
