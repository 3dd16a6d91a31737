// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/pw1_filter.h"

#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>
#include <span>

#include "combiners/normal_equations.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr PatchWelchNeighbours kNeighbours;
constexpr int kRadius = kNeighbours.outer, kSide = 2 * kRadius + 1;
// The window and one pixel around it are copied to contiguous memory, row by row: pixels at one offset from each other
// are then at one distance, and loops run over the whole window at once. The last two columns of a "row" of kPitch
// belong to the border and have weight zero, as have the corners outside of the disc.
constexpr int kPitch = kSide + 2, kBorderedSize = kPitch * kPitch;
constexpr int kUnit = 16;
constexpr int kCount = (kSide * kPitch + kUnit - 1) / kUnit * kUnit;
constexpr int kCapacity = (kCount + 2 * kPitch + 2 + kUnit - 1) / kUnit * kUnit;
constexpr int kToWindow = kPitch + 1;  // from the first bordered pixel to the first one of the window
constexpr int kCentre = kRadius * kPitch + kRadius;
static_assert(kCapacity >= kBorderedSize);

constexpr int kColumns = 8;              // 1, dx, dy, normal, depth, visibility
constexpr float kFeatureOffset = 0.05f;  // added to the largest difference that a feature column is divided by
constexpr double kRidge = 1e-2;          // relative to the sum of the weights

struct alignas(64) Bordered {
  float v[kCapacity] = {};
};
struct alignas(64) Windowed {
  float v[kCount] = {};
};

// Sums over the window are kept in so many lanes whatever the instruction set, for the same bits everywhere.
using Unit = float __attribute__((vector_size(kUnit * sizeof(float))));

// By reference: a vector that is returned would take another way in each instruction set.
void load(const float* p, Unit& out) { std::memcpy(&out, p, sizeof(out)); }

double sumOf(const Unit& lanes) {
  double sum = 0;
  for (int l = 0; l < kUnit; ++l) sum += static_cast<double>(lanes[l]);
  return sum;
}

// Row kRow of the normal equations: Σ w x_row x_k for k <= kRow, and Σ w x_row u_c.
template <int kRow>
void momentsOfRow(const std::array<Windowed, kColumns>& columns, const Windowed& weights,
                  const std::array<const float*, 3>& u, NormalEquations& out) {
  Unit products[kRow + 1] = {}, rhs[3] = {};
  for (int i = 0; i < kCount; i += kUnit) {
    Unit wx, x;
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
  for (int k = 0; k <= kRow; ++k) out.matrix[kRow][static_cast<size_t>(k)] = sumOf(products[k]);
  for (size_t c = 0; c < 3; ++c) out.rhs[kRow][c] = sumOf(rhs[c]);
}

// The neighbour o of the centre within its patch: where the window that lies around it begins, and itself.
struct PatchShift {
  int window, centre;
};

// sum_i = Σ over the shifts of (u_centre - u)² / (V_centre + V), summed over the channels, of pixels inside the image.
template <size_t kImages, bool kClipped>
void squaredDifferences(const std::vector<std::array<Bordered, 3>>& radiance, const std::array<Bordered, 3>& variance,
                        const Bordered& inside, std::span<const PatchShift> shifts,
                        std::array<Windowed, PatchWelchInput::kMaxImages>& out) {
  for (int i = 0; i < kCount; i += kUnit) {
    Unit sum[kImages] = {};
    for (const PatchShift& shift : shifts)
      for (size_t c = 0; c < 3; ++c) {
        Unit v, within, value;
        load(variance[c].v + shift.window + i, v);
        Unit inverse = 1.0f / ((variance[c].v[shift.centre] + v) + kPatchWelchEpsilon);
        if (kClipped) {
          load(inside.v + shift.window + i, within);
          inverse = within > 0 ? inverse : Unit{};
        }
        for (size_t k = 0; k < kImages; ++k) {
          load(radiance[k][c].v + shift.window + i, value);
          const Unit d = radiance[k][c].v[shift.centre] - value;
          sum[k] += d * d * inverse;
        }
      }
    for (size_t k = 0; k < kImages; ++k) std::memcpy(out[k].v + i, &sum[k], sizeof(Unit));
  }
}

// The window and the pixel around it, from its first pixel on, of a plane with this pitch. Rows of a fixed length are
// copied without a call.
void copyWindow(const float* from, ptrdiff_t pitch, Bordered& to) {
  for (int row = 0; row < kPitch; ++row) std::memcpy(to.v + row * kPitch, from + row * pitch, kPitch * sizeof(float));
}

void addCounts(const float* __restrict inside, float* __restrict count) {
  for (int i = 0; i < kCount; ++i) count[i] += inside[i];
}

void addSquares(const float* __restrict guide, float centre, float* __restrict sum) {
  for (int i = 0; i < kCount; ++i) sum[i] += (centre - guide[i]) * (centre - guide[i]);
}

// count <- 1 / count where there is any, edge <- mask 2^(spatial - edge)
void finishCommon(const float* __restrict mask, const float* __restrict spatial, float* __restrict count,
                  float* __restrict edge) {
  for (int i = 0; i < kCount; ++i) {
    count[i] = count[i] > 0 ? 1.0f / count[i] : 0.0f;
    const float w = exp2NonPositive(spatial[i] - edge[i]);
    edge[i] = mask[i] > 0 ? w : 0.0f;
  }
}

void weightsOf(const float* __restrict sum, const float* __restrict inverseCount, const float* __restrict edge,
               float scale, float* __restrict out) {
  for (int i = 0; i < kCount; ++i) {
    const float t = 1.0f - sum[i] * (inverseCount[i] * scale);
    out[i] = t > 0 ? t * t * edge[i] : 0.0f;
  }
}

// column <- (feature - centre) / (largest difference in the window + offset)
void featureColumn(const float* __restrict feature, float centre, const float* __restrict mask,
                   float* __restrict column) {
  float largest[kUnit] = {};
  for (int i = 0; i < kCount; i += kUnit)
    for (int l = 0; l < kUnit; ++l) {
      const float d = mask[i + l] > 0 ? feature[i + l] - centre : 0.0f;
      column[i + l] = d;
      largest[l] = std::max(largest[l], d < 0 ? -d : d);
    }
  const float scale = 1.0f / (*std::max_element(largest, largest + kUnit) + kFeatureOffset);
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

void addPrediction(const float* __restrict w, const float* __restrict p0, const float* __restrict p1,
                   const float* __restrict p2, float* __restrict total, float* __restrict red, float* __restrict green,
                   float* __restrict blue) {
  for (int x = 0; x < kSide; ++x) {
    total[x] += w[x];
    red[x] += w[x] * p0[x];
    green[x] += w[x] * p1[x];
    blue[x] += w[x] * p2[x];
  }
}

// All fits that reach into one tile. Their sums run in the order of the centres, row by row, in every tile.
class TileRegression {
 public:
  TileRegression(const PatchWelchInput& input, const FirstOrderOptions& options, const PixelRect& tile)
      : target_(tile),
        image_{0, 0, input.width(), input.height()},
        stride_(options.stride),
        squaredThreshold_(squaredThreshold(options.threshold, input.passes)),
        tile_(input, intersection(grown(tile, 2 * kRadius + 1), image_), tile.x0),
        sumPitch_(tile.width() + 4 * kRadius) {
    const auto size = static_cast<size_t>(sumPitch_) * static_cast<size_t>(tile.height());
    sums_.resize(input.images.size());
    for (auto& image : sums_)
      for (std::vector<float>& plane : image) plane.resize(size);
    radiance_.resize(input.images.size());
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const int i = y * kPitch + x, dx = x - kRadius, dy = y - kRadius;
        spatial_.v[i] = static_cast<float>(-static_cast<double>(kLog2E) * (dx * dx + dy * dy) /
                                           (2 * kPatchWelchSpatialSd * kPatchWelchSpatialSd));
        columns_[1].v[i] = static_cast<float>(dx) / kRadius;
        columns_[2].v[i] = static_cast<float>(dy) / kRadius;
        inWindow_.v[i] = kNeighbours.contain(dx, dy) ? 1.0f : 0.0f;
      }
    std::fill_n(columns_[0].v, kCount, 1.0f);
  }

  void run() {
    const PixelRect centres = intersection(grown(target_, kRadius), image_);
    const auto firstMultiple = [this](int x) { return (x + stride_ - 1) / stride_ * stride_; };
    for (int y = firstMultiple(centres.y0); y < centres.y1; y += stride_)
      for (int x = firstMultiple(centres.x0); x < centres.x1; x += stride_) {
        gather(x, y);
        prepare(x, y);
        const bool own = x >= target_.x0 && x < target_.x1 && y >= target_.y0 && y < target_.y1;
        for (size_t i = 0; i < radiance_.size(); ++i) {
          const NormalSolution solution = fit(i);
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

  // Copies what the fit around (x, y) reads; zero outside the image.
  void gather(int x, int y) {
    const PixelRect window = grown({x, y, x + 1, y + 1}, kRadius + 1), pixels = intersection(window, image_);
    clipped_ = pixels.width() < kPitch || pixels.height() < kPitch;
    const auto copy = [&](const PixelBuffer<float>& from, Bordered& to) {
      if (!clipped_) return copyWindow(from.data() + tile_.index(window.x0, window.y0), tile_.pitch, to);
      std::fill_n(to.v, kBorderedSize, 0.0f);
      for (int row = pixels.y0; row < pixels.y1; ++row)
        std::memcpy(to.v + (row - window.y0) * kPitch + (pixels.x0 - window.x0),
                    from.data() + tile_.index(pixels.x0, row), static_cast<size_t>(pixels.width()) * sizeof(float));
    };
    for (size_t c = 0; c < 3; ++c) {
      copy(tile_.variance[c], variance_[c]);
      for (size_t i = 0; i < radiance_.size(); ++i) copy(tile_.radiance[i][c], radiance_[i][c]);
    }
    for (size_t g = 0; g < PatchWelchTile::kGuides; ++g) copy(tile_.guide[g], guide_[g]);
    copy(tile_.depth, depth_);
    copy(tile_.visibility, visibility_);
    std::fill_n(inside_.v, kBorderedSize, 0.0f);
    for (int row = pixels.y0; row < pixels.y1; ++row)
      std::fill_n(inside_.v + (row - window.y0) * kPitch + (pixels.x0 - window.x0), pixels.width(), 1.0f);
  }

  // What all images share: edge terms, design columns, and the sums of squared differences over patches.
  void prepare(int x, int y) {
    for (int i = 0; i < kCount; ++i) mask_.v[i] = inWindow_.v[i] * inside_.v[i + kToWindow];
    std::fill_n(edge_.v, kCount, 0.0f);
    for (const Bordered& g : guide_) addSquares(g.v + kToWindow, g.v[kToWindow + kCentre], edge_.v);
    sumPatches(x, y);
    finishCommon(mask_.v, spatial_.v, inverseCount_.v, edge_.v);
    const Bordered* features[] = {&guide_[3], &guide_[4], &guide_[5], &depth_, &visibility_};
    for (size_t k = 0; k < 5; ++k)
      featureColumn(features[k]->v + kToWindow, features[k]->v[kToWindow + kCentre], mask_.v, columns_[3 + k].v);
  }

  // For each image the sum over 3 x 3 pairs of (u_p - u_q)² / (V_p + V_q), summed over the channels.
  void sumPatches(int x, int y) {
    std::fill_n(inverseCount_.v, kCount, clipped_ ? 0.0f : 9.0f);
    std::array<PatchShift, 9> shifts;
    size_t count = 0;
    for (int oy = -1; oy <= 1; ++oy)
      for (int ox = -1; ox <= 1; ++ox) {
        if (x + ox < 0 || x + ox >= image_.x1 || y + oy < 0 || y + oy >= image_.y1) continue;
        const int shift = kToWindow + oy * kPitch + ox;
        if (clipped_) addCounts(inside_.v + shift, inverseCount_.v);
        shifts[count++] = {shift, shift + kCentre};
      }
    const std::span<const PatchShift> valid(shifts.data(), count);
    const auto sum = [&]<size_t kImages>() {
      return clipped_ ? squaredDifferences<kImages, true>(radiance_, variance_, inside_, valid, patches_)
                      : squaredDifferences<kImages, false>(radiance_, variance_, inside_, valid, patches_);
    };
    radiance_.size() == 3 ? sum.template operator()<3>() : sum.template operator()<1>();
  }

  void count(const NormalSolution& solution) {
    ++report.models;
    report.raisedRidge += solution.raisedRidge && !solution.constant;
    report.constantModels += solution.constant;
    report.maxCondition = std::max(report.maxCondition, solution.condition);
  }

  // Weights, normal equations and predictions of one image.
  NormalSolution fit(size_t image) {
    const float scale = 1.0f / (3 * squaredThreshold_ * PatchWelchInput::varianceFactor(image));
    weightsOf(patches_[image].v, inverseCount_.v, edge_.v, scale, weights_.v);
    const auto& radiance = radiance_[image];
    const std::array<const float*, 3> u = {radiance[0].v + kToWindow, radiance[1].v + kToWindow,
                                           radiance[2].v + kToWindow};
    equations_.size = kColumns;
    momentsOfRow<0>(columns_, weights_, u, equations_);
    momentsOfRow<1>(columns_, weights_, u, equations_);
    momentsOfRow<2>(columns_, weights_, u, equations_);
    momentsOfRow<3>(columns_, weights_, u, equations_);
    momentsOfRow<4>(columns_, weights_, u, equations_);
    momentsOfRow<5>(columns_, weights_, u, equations_);
    momentsOfRow<6>(columns_, weights_, u, equations_);
    momentsOfRow<7>(columns_, weights_, u, equations_);
    const NormalSolution solution = solve(equations_, kRidge * equations_.matrix[0][0], false);
    for (size_t c = 0; c < 3; ++c) predict(columns_, solution, c, prediction_[c].v);
    return solution;
  }

  void scatter(int x, int y, std::array<std::vector<float>, 4>& sums) {
    for (int row = std::max(y - kRadius, target_.y0); row < std::min(y + kRadius + 1, target_.y1); ++row) {
      const ptrdiff_t at = sumIndex(x - kRadius, row);
      const int from = (row - (y - kRadius)) * kPitch;
      addPrediction(weights_.v + from, prediction_[0].v + from, prediction_[1].v + from, prediction_[2].v + from,
                    sums[0].data() + at, sums[1].data() + at, sums[2].data() + at, sums[3].data() + at);
    }
  }

  PixelRect target_, image_;
  int stride_;
  float squaredThreshold_;
  PatchWelchTile tile_;
  ptrdiff_t sumPitch_;
  std::vector<std::array<std::vector<float>, 4>> sums_;  // per image: of the weights, and of weighted predictions

  // Of the current fit.
  bool clipped_ = false;  // by the borders of the image
  std::vector<std::array<Bordered, 3>> radiance_;
  std::array<Bordered, 3> variance_;
  std::array<Bordered, PatchWelchTile::kGuides> guide_;
  Bordered depth_, visibility_, inside_;
  Windowed inWindow_, mask_, spatial_, edge_, inverse_, inverseCount_, weights_;
  std::array<Windowed, PatchWelchInput::kMaxImages> patches_;
  std::array<Windowed, kColumns> columns_;
  std::array<Windowed, 3> prediction_;
  NormalEquations equations_;
};

}  // namespace

std::vector<Rgb<float>> patchWelchFirstOrder(const PatchWelchInput& input, std::vector<Rgb<float>> zeroOrder,
                                             const FirstOrderOptions& options, const std::atomic<bool>* cancel,
                                             RegressionReport* report) {
  BRAID_ASSERT((input.images.size() == 1 || input.images.size() == 3) && zeroOrder.size() == input.images.size() &&
               options.stride >= 1 && options.tileSize >= 1);
  std::mutex reporting;
  forEachTile(input.width(), input.height(), options.tileSize, options.tileSize, [&](const PixelRect& tile) {
    if (cancel && cancel->load(std::memory_order_relaxed)) return;
    const auto regression = std::make_unique<TileRegression>(input, options, tile);
    runVectorised([&] { regression->run(); });
    regression->blendInto(zeroOrder, options.kappa);
    if (!report) return;
    const std::lock_guard lock(reporting);
    *report += regression->report;
  });
  return zeroOrder;
}

}  // namespace braid
