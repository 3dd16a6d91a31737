// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw/pw1_filter.h"

#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>
#include <span>

#include "combiners/regression/normal_equations.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr PatchWelchNeighbours kNeighbours;
constexpr int kRadius = kNeighbours.radius, kSide = 2 * kRadius + 1;
// The window is copied to contiguous memory, row by row, so that loops run over all of it at once. The corners outside
// of the disc have weight zero.
constexpr int kUnit = 16;
constexpr int kCount = (kSide * kSide + kUnit - 1) / kUnit * kUnit;
constexpr int kCentre = kRadius * kSide + kRadius;

constexpr int kColumns = 8;              // 1, dx, dy, normal, depth, visibility
constexpr float kFeatureOffset = 0.05f;  // added to the largest difference that a feature column is divided by
constexpr double kRidge = 1e-2;          // relative to the sum of the weights

struct alignas(64) Windowed {
  float v[kCount] = {};
};

// Sums over the window are kept in so many lanes whatever the instruction set, for the same bits everywhere.
using Unit = float __attribute__((vector_size(kUnit * sizeof(float))));

// Some of the lanes.
template <int kLanes>
struct PartOf {
  typedef float Type __attribute__((vector_size(kLanes * sizeof(float))));
};

// By reference: a vector that is returned would take another way in each instruction set.
template <class Lanes>
void load(const float* p, Lanes& out) {
  std::memcpy(&out, p, sizeof(out));
}

template <class Lanes>
void addLanes(const Lanes& lanes, double& sum) {
  for (size_t l = 0; l < sizeof(Lanes) / sizeof(float); ++l) sum += static_cast<double>(lanes[l]);
}

// Row kRow of the normal equations: Σ w x_row x_k for k <= kRow, and Σ w x_row u_c. kLanes of the lanes at a time,
// which leaves the sums in registers.
template <int kRow, int kLanes>
void momentsOfRow(const std::array<Windowed, kColumns>& columns, const Windowed& weights,
                  const std::array<const float*, 3>& u, NormalEquations& out) {
  using Part = typename PartOf<kLanes>::Type;
  double sums[kRow + 4] = {};
  for (int first = 0; first < kUnit; first += kLanes) {
    Part products[kRow + 1] = {}, rhs[3] = {};
    for (int i = first; i < kCount; i += kUnit) {
      Part wx, x;
      load(weights.v + i, wx);
      load(columns[kRow].v + i, x);
      wx *= x;
      for (int k = 0; k <= kRow; ++k) {
        load(columns[static_cast<size_t>(k)].v + i, x);
        products[k] += wx * x;
      }
      for (size_t c = 0; c < 3; ++c) {
        load(u[c] + i, x);
        rhs[c] += wx * x;
      }
    }
    for (int k = 0; k <= kRow; ++k) addLanes(products[k], sums[k]);
    for (int c = 0; c < 3; ++c) addLanes(rhs[c], sums[kRow + 1 + c]);
  }
  for (int k = 0; k <= kRow; ++k) out.matrix[kRow][static_cast<size_t>(k)] = sums[k];
  for (size_t c = 0; c < 3; ++c) out.rhs[kRow][c] = sums[static_cast<size_t>(kRow) + 1 + c];
}

template <int kLanes>
void moments(const std::array<Windowed, kColumns>& columns, const Windowed& weights,
             const std::array<const float*, 3>& u, NormalEquations& out) {
  momentsOfRow<0, kLanes>(columns, weights, u, out);
  momentsOfRow<1, kLanes>(columns, weights, u, out);
  momentsOfRow<2, kLanes>(columns, weights, u, out);
  momentsOfRow<3, kLanes>(columns, weights, u, out);
  momentsOfRow<4, kLanes>(columns, weights, u, out);
  momentsOfRow<5, kLanes>(columns, weights, u, out);
  momentsOfRow<6, kLanes>(columns, weights, u, out);
  momentsOfRow<7, kLanes>(columns, weights, u, out);
}

// The window, from its first pixel on, of a plane with this pitch. Rows of a fixed length are copied without a call.
void copyWindow(const float* from, ptrdiff_t pitch, Windowed& to) {
  for (int row = 0; row < kSide; ++row) std::memcpy(to.v + row * kSide, from + row * pitch, kSide * sizeof(float));
}

// column <- (feature - centre) / (largest difference in the window + offset)
void featureColumn(const float* __restrict feature, float centre, const float* __restrict mask,
                   float* __restrict column) {
  Unit largest = {}, within, d;
  for (int i = 0; i < kCount; i += kUnit) {
    load(mask + i, within);
    load(feature + i, d);
    d = within > 0 ? d - centre : Unit{};
    std::memcpy(column + i, &d, sizeof(d));
    const Unit size = d < 0 ? -d : d;
    largest = largest < size ? size : largest;
  }
  float most = 0;
  for (int l = 0; l < kUnit; ++l) most = std::max(most, largest[l]);
  const float scale = 1.0f / (most + kFeatureOffset);
  for (int i = 0; i < kCount; ++i) column[i] *= scale;
}

// Σ_k coefficient_k column_k of one channel.
void predict(const std::array<Windowed, kColumns>& columns, const NormalSolution& solution, size_t channel,
             float* __restrict out) {
  float coefficients[kColumns];
  for (size_t k = 0; k < kColumns; ++k) coefficients[k] = static_cast<float>(solution.coefficients[k][channel]);
  for (int i = 0; i < kCount; i += kUnit) {
    Unit sum = coefficients[0] - Unit{}, x;
    for (size_t k = 1; k < kColumns; ++k) {
      load(columns[k].v + i, x);
      sum += coefficients[k] * x;
    }
    std::memcpy(out + i, &sum, sizeof(sum));
  }
}

void addRow(const float* __restrict w, float* __restrict sum) {
  for (int x = 0; x < kSide; ++x) sum[x] += w[x];
}

void addWeightedRow(const float* __restrict w, const float* __restrict value, float* __restrict sum) {
  for (int x = 0; x < kSide; ++x) sum[x] += w[x] * value[x];
}

// All fits that reach into one tile. Their sums run in the order of the centres, row by row, in every tile.
class TileRegression {
 public:
  TileRegression(const PatchWelchInput& input, const FirstOrderOptions& options, const PatchWelchWeights& weights,
                 const PixelRect& tile)
      : target_(tile),
        image_{0, 0, input.width(), input.height()},
        stride_(options.stride),
        kept_(weights),
        neighbours_(weights.count()),
        tile_(input, intersection(grown(tile, 2 * kRadius), image_), tile.x0),
        sumPitch_(tile.width() + 4 * kRadius) {
    const auto size = static_cast<size_t>(sumPitch_) * static_cast<size_t>(tile.height());
    sums_.resize(input.images.size());
    for (auto& image : sums_)
      for (std::vector<float>& plane : image) plane.resize(size);
    radiance_.resize(input.images.size());
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const int i = y * kSide + x, dx = x - kRadius, dy = y - kRadius;
        columns_[1].v[i] = static_cast<float>(dx) / kRadius;
        columns_[2].v[i] = static_cast<float>(dy) / kRadius;
        if (!kNeighbours.contain(dx, dy)) continue;
        inWindow_.v[i] = 1;
        neighbours_[weights.order(dx, dy)] = i;
      }
    std::fill_n(columns_[0].v, kCount, 1.0f);
  }

  void run() {
    const PixelRect centres = intersection(grown(target_, kRadius), image_);
    const auto firstMultiple = [this](int x) { return (x + stride_ - 1) / stride_ * stride_; };
    for (int y = firstMultiple(centres.y0); y < centres.y1; y += stride_)
      for (int x = firstMultiple(centres.x0); x < centres.x1; x += stride_) {
        gather(x, y);
        const bool own = x >= target_.x0 && x < target_.x1 && y >= target_.y0 && y < target_.y1;
        for (size_t i = 0; i < radiance_.size(); ++i) {
          const NormalSolution solution = fit(x, y, i);
          if (own) count(solution);
          scatter(x, y, sums_[i]);
        }
      }
  }

  // Of the fits whose centres lie in the tile.
  RegressionReport report;

  // Blends with the zero-order results, which are in `images`.
  void blendInto(std::vector<Rgb<float>>& images, float kappa) const {
    for (size_t k = 0; k < images.size(); ++k)
      for (size_t c = 0; c < 3; ++c)
        for (int y = target_.y0; y < target_.y1; ++y)
          for (int x = target_.x0; x < target_.x1; ++x) {
            const auto at = static_cast<size_t>(sumIndex(x, y));
            const float a = tile_.divisor[c][static_cast<size_t>(tile_.index(x, y))];
            float& image = images[k][c].at(x, y);
            image = (a * sums_[k][1 + c][at] + kappa * image) / (sums_[k][0][at] + kappa);
          }
  }

 private:
  // Rows of sums have a margin, so that whole rows of a window can be added.
  ptrdiff_t sumIndex(int x, int y) const {
    return static_cast<ptrdiff_t>(y - target_.y0) * sumPitch_ + (x - target_.x0 + 2 * kRadius);
  }

  // Copies what the fit around (x, y) reads, zero outside the image, and makes the columns that all images share.
  void gather(int x, int y) {
    const PixelRect window = grown({x, y, x + 1, y + 1}, kRadius), pixels = intersection(window, image_);
    const bool clipped = pixels.width() < kSide || pixels.height() < kSide;
    const auto place = [&](int row) { return (row - window.y0) * kSide + (pixels.x0 - window.x0); };
    const auto copy = [&](const PixelBuffer<float>& from, Windowed& to) {
      if (!clipped) return copyWindow(from.data() + tile_.index(window.x0, window.y0), tile_.pitch, to);
      std::fill_n(to.v, kCount, 0.0f);
      for (int row = pixels.y0; row < pixels.y1; ++row)
        std::memcpy(to.v + place(row), from.data() + tile_.index(pixels.x0, row),
                    static_cast<size_t>(pixels.width()) * sizeof(float));
    };
    for (size_t i = 0; i < radiance_.size(); ++i)
      for (size_t c = 0; c < 3; ++c) copy(tile_.radiance[i][c], radiance_[i][c]);
    Windowed mask;
    for (int row = pixels.y0; row < pixels.y1; ++row)
      std::copy_n(inWindow_.v + place(row), pixels.width(), mask.v + place(row));
    const PixelBuffer<float>* features[] = {&tile_.guide[3], &tile_.guide[4], &tile_.guide[5], &tile_.depth,
                                            &tile_.visibility};
    for (size_t k = 0; k < 5; ++k) {
      copy(*features[k], feature_);
      featureColumn(feature_.v, feature_.v[kCentre], mask.v, columns_[3 + k].v);
    }
  }

  void count(const NormalSolution& solution) {
    ++report.models;
    report.raisedRidge += solution.raisedRidge && !solution.constant;
    report.constantModels += solution.constant;
    report.maxCondition = std::max(report.maxCondition, solution.condition);
  }

  // The weights of the window around (x, y); that of the centre with itself is 1.
  void unpackWeights(int x, int y, size_t image) {
    const uint16_t* from = kept_.of(x, y, image);
    for (size_t k = 0; k < neighbours_.size(); ++k) weights_.v[neighbours_[k]] = PatchWelchWeights::unpacked(from[k]);
    weights_.v[kCentre] = 1;
  }

  // Weights, normal equations and predictions of one image.
  NormalSolution fit(int x, int y, size_t image) {
    unpackWeights(x, y, image);
    const auto& radiance = radiance_[image];
    const std::array<const float*, 3> u = {radiance[0].v, radiance[1].v, radiance[2].v};
    equations_.size = kColumns;
    vectorLevel() == VectorLevel::Avx512 ? moments<16>(columns_, weights_, u, equations_)
                                         : moments<8>(columns_, weights_, u, equations_);
    const NormalSolution solution = solve(equations_, kRidge * equations_.matrix[0][0], false);
    for (size_t c = 0; c < 3; ++c) predict(columns_, solution, c, prediction_[c].v);
    return solution;
  }

  void scatter(int x, int y, std::array<std::vector<float>, 4>& sums) {
    for (int row = std::max(y - kRadius, target_.y0); row < std::min(y + kRadius + 1, target_.y1); ++row) {
      const ptrdiff_t at = sumIndex(x - kRadius, row);
      const int from = (row - (y - kRadius)) * kSide;
      addRow(weights_.v + from, sums[0].data() + at);
      for (size_t c = 0; c < 3; ++c)
        addWeightedRow(weights_.v + from, prediction_[c].v + from, sums[1 + c].data() + at);
    }
  }

  PixelRect target_, image_;
  int stride_;
  const PatchWelchWeights& kept_;
  std::vector<int> neighbours_;  // where they are in the window, in the order of kept_
  PatchWelchTile tile_;
  ptrdiff_t sumPitch_;
  std::vector<std::array<std::vector<float>, 4>> sums_;  // per image: of the weights, and of weighted predictions

  // Of the current fit.
  std::vector<std::array<Windowed, 3>> radiance_;
  Windowed inWindow_, feature_, weights_;
  std::array<Windowed, kColumns> columns_;
  std::array<Windowed, 3> prediction_;
  NormalEquations equations_;
};

}  // namespace

std::vector<Rgb<float>> patchWelchFirstOrder(const PatchWelchInput& input, const FirstOrderOptions& options,
                                             const std::atomic<bool>* cancel, RegressionReport* report) {
  BRAID_ASSERT((input.images.size() == 1 || input.images.size() == 3) && options.stride >= 1 && options.tileSize >= 1);
  PatchWelchWeights weights(input.width(), input.height(), input.images.size(), options.stride, kNeighbours);
  std::vector<Rgb<float>> out =
      std::move(patchWelch(input, std::array{options.threshold}, kNeighbours, {}, cancel, &weights)[0]);
  std::mutex reporting;
  forEachTile(input.width(), input.height(), options.tileSize, options.tileSize, [&](const PixelRect& tile) {
    if (cancel && cancel->load(std::memory_order_relaxed)) return;
    const auto regression = std::make_unique<TileRegression>(input, options, weights, tile);
    runVectorised([&] { regression->run(); });
    regression->blendInto(out, options.kappa);
    if (!report) return;
    const std::lock_guard lock(reporting);
    *report += regression->report;
  });
  return out;
}

}  // namespace braid
