// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/rdfc/rdfc_candidates.h"

#include <cmath>
#include <span>

#include "combiners/denoise/rdfc/rdfc_pairs.h"

namespace braid {

namespace {

using namespace rdfc;

constexpr int kWindow = 10, kLargestPatch = 3;
constexpr float kColourK = 0.45f;

// Contiguous planes of a tile's rows.
class TilePlanes {
 public:
  TilePlanes(const PixelRect& tile, size_t planes)
      : tile_(tile),
        pitch_(static_cast<size_t>(rdfcRowCount(tile.width()))),
        data_(pitch_ * static_cast<size_t>(tile.height()) * planes) {}
  float* row(size_t plane, int y) {
    return data_.data() + (plane * static_cast<size_t>(tile_.height()) + static_cast<size_t>(y - tile_.y0)) * pitch_;
  }

 private:
  PixelRect tile_;
  size_t pitch_;
  std::vector<float> data_;
};

// Weighted sums over the window, of some planes.
struct Sums {
  Sums(const PixelRect& tile, size_t planes) : values(tile, planes), total(tile, 1), most(tile, 1) {
    for (int y = tile.y0; y < tile.y1; ++y) std::fill_n(most.row(0, y), rdfcRowCount(tile.width()), kLeastOwnWeight);
  }
  TilePlanes values, total, most;

  void addWeightsAt(int y, const float* forward, const float* backward, int count) {
    addWeights(forward, backward, count, total.row(0, y), most.row(0, y));
  }
  // The weighted mean where the pixel itself has the value `own`.
  float mean(size_t plane, int y, int x, float own) {
    const float w = most.row(0, y)[x];
    return (values.row(plane, y)[x] + w * own) / (total.row(0, y)[x] + w);
  }
  float ownShare(int y, int x) {
    const float w = most.row(0, y)[x];
    return w / (total.row(0, y)[x] + w);
  }
};

// One candidate in one tile: of the images, and of the mean with its centre moved.
struct CandidateSums {
  CandidateSums(const PixelRect& tile, size_t images, bool perturbed)
      : plain(tile, 3 * images), moved(tile, perturbed ? 3 : 0) {}
  Sums plain, moved;
};

using ImagePointer = std::array<const MirroredPlane*, 3>;

class CandidateTile {
 public:
  CandidateTile(const RdfcColour& colour, const std::vector<RdfcGuide>& features, const PixelRect& tile)
      : colour_(colour),
        features_(features),
        tile_(tile),
        count_(rdfcRowCount(tile.width())),
        pitch_(rdfcRowCount(tile.width() + 2 * kLargestPatch) + kRdfcRowUnit),
        fine_(static_cast<size_t>(pitch_)),
        coarse_(static_cast<size_t>(pitch_)),
        mean_{&colour.guide[0].mean, &colour.guide[1].mean, &colour.guide[2].mean} {
    for (const auto& image : colour.images) images_.push_back({&image[0], &image[1], &image[2]});
    const size_t rows = static_cast<size_t>(tile.height() + 2 * kLargestPatch), pitch = static_cast<size_t>(pitch_);
    for (auto& block : narrow_) block.resize(rows * pitch);
    for (auto& block : wide_) block.resize(rows * pitch);
    for (auto& block : change_) block.resize(rows * pitch);
    for (auto& row : weights_) row.resize(pitch);
    for (size_t k = 0; k < kRdfcCandidates; ++k)
      if (k < 2 || !features.empty()) sums_.emplace_back(tile, colour.images.size(), k < 2);
  }

  void addOffset(int dx, int dy) {
    for (int y = tile_.y0 - kLargestPatch; y < tile_.y1 + kLargestPatch; ++y) addDistanceRow(dx, dy, y);
    for (int y = tile_.y0; y < tile_.y1; ++y) {
      const TripleRow row{dx, dy, tile_.x0, y, count_};
      coarse_.clear(count_);
      if (!features_.empty()) addFeatureRow(row);
      addColourCandidate<1>(sums_[0], narrow_, row);
      addColourCandidate<3>(sums_[1], wide_, row);
    }
  }

  void store(std::vector<RdfcCandidate>& out) {
    for (size_t k = 0; k < out.size(); ++k)
      for (int y = tile_.y0; y < tile_.y1; ++y)
        for (int x = 0; x < tile_.width(); ++x) storePixel(sums_[k], k < 2, x, y, out[k]);
  }

 private:
  using Blocks = std::array<std::vector<float>, 3>;

  RdfcRows rowsAt(Blocks& blocks, int y) {
    const ptrdiff_t at = static_cast<ptrdiff_t>(y - (tile_.y0 - kLargestPatch)) * pitch_;
    return {blocks[0].data() + at, blocks[1].data() + at, blocks[2].data() + at};
  }

  // Distances of pixels and their change, and the distances summed over the widths of both patches.
  void addDistanceRow(int dx, int dy, int y) {
    const RdfcRows pixels = coarse_.distance();
    const RdfcRows change = rowsAt(change_, y), narrow = rowsAt(narrow_, y), wide = rowsAt(wide_, y);
    colourRows<true>(colour_.guide, kColourK, Spread::Both,
                     {dx, dy, tile_.x0 - kLargestPatch, y, rdfcRowCount(tile_.width() + 2 * kLargestPatch)}, pixels,
                     change);
    boxRow<1>(pixels.forward + 2, count_, narrow.forward);
    boxRow<1>(pixels.backward + 2, count_, narrow.backward);
    boxRow<1>(pixels.both + 2, count_, narrow.both);
    boxRow<3>(pixels.forward, count_, wide.forward);
    boxRow<3>(pixels.backward, count_, wide.backward);
    boxRow<3>(pixels.both, count_, wide.both);
  }

  // The weights of the features, and the candidate that has nothing else.
  void addFeatureRow(const TripleRow& row) {
    fine_.clear(count_);
    for (const RdfcGuide& feature : features_) {
      featureRows<true>(feature, Spread::Both, row, fine_.distance(), coarse_.distance());
      const float scale = 1.0f / static_cast<float>(feature.size());
      fine_.add(scale, count_);
      coarse_.add(scale, count_);
    }
    fine_.finish(count_);
    coarse_.finish(count_);
    addTargets(sums_[2].plain, images_, row, fine_.forward(), fine_.backward());
  }

  template <int kPatch>
  void addColourCandidate(CandidateSums& sums, Blocks& blocks, const TripleRow& row) {
    constexpr float kScale = 1.0f / (3 * (2 * kPatch + 1) * (2 * kPatch + 1));
    const RdfcRows first = rowsAt(blocks, row.y - kPatch), distance = coarse_.distance();
    const RdfcRows change = rowsAt(change_, row.y);
    boxColumn<kPatch>(first.forward, pitch_, count_, distance.forward);
    boxColumn<kPatch>(first.backward, pitch_, count_, distance.backward);
    boxColumn<kPatch>(first.both, pitch_, count_, distance.both);
    addWithColour(sums.plain, images_, distance, kScale, row);
    addChange(change.forward + kLargestPatch, distance.forward);
    addChange(change.backward + kLargestPatch, distance.backward);
    addChange(change.both + kLargestPatch, distance.both);
    addWithColour(sums.moved, {&mean_, 1}, distance, kScale, row);
  }

  // Images weighted by the smaller one of the features' weights and those of the distances.
  void addWithColour(Sums& sums, std::span<const ImagePointer> images, const RdfcRows& distance, float scale,
                     const TripleRow& row) {
    float *forward = weights_[0].data(), *backward = weights_[1].data();
    std::copy_n(coarse_.forward(), count_, forward);
    std::copy_n(coarse_.backward(), count_, backward);
    minWithWeights(distance, scale, count_, forward, backward);
    addTargets(sums, images, row, forward, backward);
  }

  void addChange(const float* __restrict change, float* __restrict distance) {
    for (int x = 0; x < count_; ++x) distance[x] += change[x];
  }

  void addTargets(Sums& sums, std::span<const ImagePointer> images, const TripleRow& row, const float* forward,
                  const float* backward) {
    sums.addWeightsAt(row.y, forward, backward, count_);
    for (size_t i = 0; i < images.size(); ++i)
      for (size_t c = 0; c < 3; ++c) {
        const MirroredPlane& plane = *images[i][c];
        addWeighted(forward, backward, plane.at(row.x + row.dx, row.y + row.dy),
                    plane.at(row.x - row.dx, row.y - row.dy), count_, sums.values.row(3 * i + c, row.y));
      }
  }

  void storePixel(CandidateSums& sums, bool perturbed, int x, int y, RdfcCandidate& out) {
    const size_t at = out.risk.index(tile_.x0 + x, y);
    const auto noisy = [&](const MirroredPlane& plane) { return plane.at(tile_.x0 + x, y)[0]; };
    float filtered[3] = {0, 0, 0}, derivative[3] = {0, 0, 0};
    for (size_t i = 0; i < images_.size(); ++i)
      for (size_t c = 0; c < 3; ++c) {
        out.images[i][c][at] = sums.plain.mean(3 * i + c, y, x, noisy(*images_[i][c]));
        filtered[c] += colour_.shares[i] * out.images[i][c][at];
      }
    bool valid = perturbed;
    for (size_t c = 0; perturbed && c < 3; ++c) {
      const float own = noisy(*mean_[c]), step = kPerturbation * own;
      derivative[c] = (sums.moved.mean(c, y, x, own + step) - filtered[c]) / step;
      valid = valid && std::fabs(step) > kDistanceEpsilon && derivative[c] >= 0 && derivative[c] <= 1;
    }
    float risk = 0, slopes = 0;
    for (size_t c = 0; c < 3; ++c) {
      const float slope = valid ? derivative[c] : sums.plain.ownShare(y, x),
                  variance = noisy(colour_.guide[c].variance);
      const float moved = filtered[c] - noisy(*mean_[c]);
      risk += moved * moved + 2 * variance * slope - variance;
      slopes += slope;
    }
    out.risk[at] = risk / 3;
    out.derivative[at] = slopes / 3;
  }

  const RdfcColour& colour_;
  const std::vector<RdfcGuide>& features_;
  PixelRect tile_;
  int count_, pitch_;
  // Rows from tile.y0 - 3 on: sums of distances over the widths of both patches, which begin at tile.x0; and the change
  // of single pixels, which begins at tile.x0 - 3.
  Blocks narrow_, wide_, change_;
  SmallestWeight fine_, coarse_;               // of the features; the distances of `coarse_` serve the colour too
  std::array<std::vector<float>, 2> weights_;  // of a candidate, forward and backward
  ImagePointer mean_;
  std::vector<ImagePointer> images_;
  std::vector<CandidateSums> sums_;
};

}  // namespace

std::vector<RdfcCandidate> rdfcCandidates(const RdfcColour& colour, const std::vector<RdfcGuide>& features,
                                          const std::atomic<bool>* cancel) {
  const int width = colour.guide[0].mean.width(), height = colour.guide[0].mean.height();
  std::vector<RdfcCandidate> out(features.empty() ? kRdfcCandidates - 1 : kRdfcCandidates);
  for (RdfcCandidate& candidate : out) {
    candidate.images.assign(colour.images.size(), Rgb<float>(width, height));
    candidate.risk = candidate.derivative = Plane<float>(width, height);
  }
  forEachTile(width, height, kRdfcTileWidth, kRdfcTileHeight, [&](const PixelRect& rect) {
    if (cancel && cancel->load(std::memory_order_relaxed)) return;
    CandidateTile tile(colour, features, rect);
    forEachRdfcOffset(kWindow, [&](int dx, int dy) { runVectorised([&] { tile.addOffset(dx, dy); }); });
    tile.store(out);
  });
  return out;
}

}  // namespace braid
