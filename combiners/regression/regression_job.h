// SPDX-License-Identifier: Apache-2.0
// What the two phases of a collaborative regression share: fitting models and adding up their predictions.
#pragma once

#include <algorithm>
#include <vector>

#include "combiners/pixels/packed_rows.h"
#include "combiners/regression/regression.h"
#include "combiners/pixels/simd.h"

namespace braid::regression {

static_assert(kLanes <= WindowWeights::kRowSlack && kLanes <= PackedRows::kSlack);

// Pixels of less weight, where the centre's is 1, are nothing: vectors of them are left out.
constexpr float kLeastWeight = 1e-8f;

// The inputs, packed.
struct Job {
  const RegressionInputs& inputs;
  const RegressionSettings& settings;
  int width = 0, height = 0;
  PackedRows features, targets;
  std::vector<int> groupEnd;  // one past the last feature plane of every group

  int colours = 3;                                    // right-hand sides: one image or two
  int size() const { return features.planes() + 1; }  // unknowns of a model: the intercept first
  bool cancelled() const { return settings.cancel && settings.cancel->load(std::memory_order_relaxed); }
};

struct Span {
  int begin, end;
  int length() const { return end - begin; }
};

inline Span window(int centre, int radius, int size) {
  return {std::max(0, centre - radius), std::min(size, centre + radius + 1)};
}

// The models of a band of centre rows; a row takes the place of one that no pixel needs any more.
class Models {
 public:
  Models(const Job& job, int capacity)
      : columns_(centreCount(job.width, job.settings.stride)),
        stride_(static_cast<size_t>(job.colours * job.size())),
        capacity_(capacity),
        data_(static_cast<size_t>(capacity) * static_cast<size_t>(columns_) * stride_) {}
  int columns() const { return columns_; }
  float* at(int column, int row) {
    return data_.data() + static_cast<size_t>((row % capacity_) * columns_ + column) * stride_;
  }

 private:
  int columns_;
  size_t stride_;
  int capacity_;
  std::vector<float> data_;
};

}  // namespace braid::regression
