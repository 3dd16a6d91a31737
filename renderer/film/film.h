// SPDX-License-Identifier: Apache-2.0
// The film: PassTarget receives one pass of one integrator, Accumulator turns passes into means, buckets and variances.
//
// "Variance" is the variance of the pixel mean, computed over pass values, so that splats, photons, environment pixels
// and rejected samples are in it for every integrator (Veach-style per-sample statistics would miss the splats).
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/core/raw_sums.h"
#include "renderer/film/features.h"
#include "renderer/film/sample_placement.h"

namespace braid {

// A window of the full frame, in pixels: [x0, x1) × [y0, y1).
struct PixelWindow {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool operator==(const PixelWindow&) const = default;
};

// What a pass writes besides the values of pixels.
struct PassPlanes {
  bool splats = false, features = false, coverage = false, bias = false;
  bool direct = false;  // direct light by itself

  // Of what a film gets; splats are the integrator's own memory.
  uint64_t bytesPerPixel() const;
};

// What an integrator writes during one pass. add() and features() belong to the task that owns the pixel; splat() may
// be called by any thread for any pixel: integer sums commute, so the result does not depend on the order.
class PassTarget {
 public:
  PassTarget(int width, int height, const PassPlanes& planes);

  int width() const { return width_; }
  int height() const { return height_; }
  bool wantsFeatures() const { return !features_.empty(); }
  bool wantsCoverage() const { return !coverage_.empty(); }
  bool wantsBias() const { return !bias_.empty(); }
  bool wantsDirect() const { return !direct_.empty(); }

  // Sets the value of the task's own pixel in this pass. A non-finite or negative value counts as a sample of value 0
  // and is counted as rejected; returns false then.
  bool add(int x, int y, const Spectrum& value);
  // The same where a negative value is legitimate noise: for integrators that may be negative. Only a non-finite value
  // is rejected.
  bool addSigned(int x, int y, const Spectrum& value);
  // Adds to any pixel in fixed point (2⁻³², clamped at 2²² and counted). Returns false when rejected.
  bool splat(int x, int y, const Spectrum& value);
  // Moves the fixed point: unit 2^-bits, clamp at 2^(54-bits); 512 clamped splats fit one pixel and pass. Scenes in
  // physical light units choose `bits` once from their total light power, so that scaling all lights scales the image
  // and nothing else. Default 32; call before the first splat of a pass.
  void setSplatFractionBits(int bits);
  void features(int x, int y, const FeatureSample& sample);
  // How much of the pixel the camera path saw covered, in [0, 1]; only when wantsCoverage().
  void coverage(int x, int y, float value) { coverage_.at(x, y) = value; }

  // The estimated bias of this pass' value of the pixel, of either sign; only when wantsBias(). A non-finite one counts
  // as 0 and as rejected.
  void bias(int x, int y, const Spectrum& value);
  // The direct part of the value that add() was given (Estimate::direct); only when wantsDirect(). A value that add()
  // would reject counts as 0.
  void direct(int x, int y, const Spectrum& value);

  // Zeroes everything, for the next pass; keeps the allocation.
  void clear();
  // The same for a pass of these tiles of SamplePlacement alone, by whose pixels, all written, it is committed; not
  // with splats.
  void clearFor(const std::vector<bool>& tiles);
  // Calls body(first pixel, count) for runs of pixels of one row that are committed, parallel over rows.
  template <class Body>
  void forEachRun(const Body& body) const;
  uint64_t rejected() const { return rejected_.load(); }
  uint64_t clampedSplats() const { return clampedSplats_.load(); }

 private:
  friend class Accumulator;
  friend class FeatureAccumulator;
  friend class CoverageAccumulator;
  friend class DirectLightAccumulator;

  int width_, height_;
  std::vector<std::vector<std::pair<int, int>>> runs_;  // of the rows of each row of tiles; none: whole rows
  Rgb<float> own_;
  std::vector<int64_t> splats_;         // 3 per pixel, interleaved; empty when the integrator does not splat
  std::vector<Plane<float>> features_;  // kFeatureComponents planes, or empty
  Plane<float> coverage_;               // or empty
  Rgb<float> bias_;                     // or empty
  Rgb<float> direct_;                   // or empty
  double splatScale_ = 4294967296.0;    // fixed-point units per 1
  double splatClamp_ = 4194304.0;
  std::atomic<uint64_t> rejected_{0}, clampedSplats_{0};
};

template <class Body>
void PassTarget::forEachRun(const Body& body) const {
  parallelRows(height_, [&](int y) {
    const size_t row = own_[0].index(0, y);
    if (runs_.empty()) return body(row, static_cast<size_t>(width_));
    for (const auto& [begin, end] : runs_[static_cast<size_t>(y / SamplePlacement::kTile)])
      body(row + static_cast<size_t>(begin), static_cast<size_t>(end - begin));
  });
}

// Which squares of values an accumulator keeps: of all passes, or of the halves apart, as SamplePlacement needs them.
enum class KeptSquares { Together, Halves };

// Sums of one integrator's passes. Bucket of a pass = pass % bucketCount(); half A = even buckets, B = odd ones. All
// pixels have the same count, but for PlacedSums. 120 bytes a pixel with four buckets, 72 with two; 72 more with
// estimates of the bias, 24 with the squares of halves.
class Accumulator {
 public:
  Accumulator(int width, int height, int buckets, bool bias = false, KeptSquares squares = KeptSquares::Together);

  // Adds the pass: v = own + splats, sum[pass % K] += v, sumsq += v²; likewise the bias. Parallel over rows. `counts`:
  // false for more samples of a pass that has been added already.
  void commit(uint64_t pass, const PassTarget& target, bool counts = true);
  // The same of one plane of values a pass.
  void commit(uint64_t pass, const Rgb<float>& values);
  // Part of that, without counting: so many pixels from one on.
  void commitRun(uint64_t pass, const Rgb<float>& values, size_t begin, size_t count);
  void countPass(uint64_t pass) { ++count_[pass % count_.size()]; }

  int width() const { return squares_[0].width(); }
  int height() const { return squares_[0].height(); }
  int bucketCount() const { return static_cast<int>(count_.size()); }
  uint64_t passes() const;
  uint64_t passesInBucket(int k) const { return count_[static_cast<size_t>(k)]; }
  uint64_t rejected() const { return rejected_; }
  uint64_t clampedSplats() const { return clampedSplats_; }

  Rgb<float> mean() const;
  Rgb<float> bucketMean(int k) const;   // zero where the bucket is empty
  Rgb<float> halfMean(int half) const;  // 0 = A, 1 = B
  // Variance of the mean from pass values: (sumsq/n - mean²)/(n - 1), never negative; zero for n < 2. Conservative when
  // passes of a bucket share a low-discrepancy sequence.
  Rgb<float> passVariance() const;
  // The calibrated variance of the mean. `lowDiscrepancy` false: passVariance(). True: passVariance() rescaled by the
  // variance between buckets, which have independent scrambles (renderer/README.md, Calibrated variance).
  Rgb<float> variance(bool lowDiscrepancy) const;

  // The mean estimate of the bias, those of the halves, and the variance of the mean; empty when bias is not kept.
  bool keepsBias() const { return keepsBias_; }
  Rgb<float> biasMean() const;
  Rgb<float> biasHalfMean(int half) const;
  Rgb<float> biasVariance() const;

  // For state files: what a file holds, and back. Sums are called `sum` and the bucket, and `squares`.
  void listSums(const std::string& sum, const std::string& squares, RawSums& list);
  void listBias(const std::string& bias, RawSums& list);
  void setCounts(std::vector<uint64_t> counts, uint64_t rejected, uint64_t clampedSplats);
  const Rgb<double>& biasSum(int half) const { return biasSum_[half]; }
  const Rgb<double>& biasSumOfSquares() const { return biasSumsq_; }
  const std::vector<Rgb<double>>& sums() const { return sum_; }
  const Rgb<double>& sumOfSquares() const { return squares_[0]; }
  // One image, or those of the halves.
  const std::vector<Rgb<double>>& squares() const { return squares_; }
  static Accumulator fromSums(std::vector<Rgb<double>> sums, std::vector<Rgb<double>> squares,
                              std::vector<uint64_t> counts);
  static Accumulator fromSums(std::vector<Rgb<double>> sums, Rgb<double> sumOfSquares, std::vector<uint64_t> counts,
                              uint64_t rejected, uint64_t clampedSplats);
  // Of other passes, whose sums are added by addSums().
  void addCounts(const Accumulator& other);

 private:
  Rgb<float> meanOfBuckets(int first, int step) const;
  void commitBias(int half, const PassTarget& target);
  // Variance of the mean from the spread of the bucket means (independent scrambles).
  Plane<double> bucketVariance(size_t channel) const;
  // Where the squares of a pass go.
  Rgb<double>& squaresOf(uint64_t pass) { return squares_[pass % squares_.size()]; }
  std::vector<Rgb<double>> sum_, squares_;
  bool keepsBias_;
  Rgb<double> biasSum_[2], biasSumsq_;  // of the halves, and of all passes; or empty
  std::vector<uint64_t> count_;
  uint64_t rejected_ = 0, clampedSplats_ = 0;
};

// Mean, halves and variance of the mean of the features, kept once per render (they do not depend on the integrator).
class FeatureAccumulator {
 public:
  FeatureAccumulator(int width, int height);
  void commit(uint64_t pass, const PassTarget& target, bool counts = true);
  uint64_t passes() const { return count_[0] + count_[1]; }
  Plane<float> mean(int component) const;
  Plane<float> halfMean(int component, int half) const;
  Plane<float> variance(int component) const;

  // For state files: what a file holds, and back.
  void listSums(const std::string& name, RawSums& list);
  void setCounts(uint64_t passesA, uint64_t passesB);
  uint64_t passesInHalf(int half) const { return count_[half]; }
  const std::vector<Plane<double>>& sums(int half) const { return sum_[half]; }
  const std::vector<Plane<double>>& sumsOfSquares() const { return sumsq_; }
  void addCounts(const FeatureAccumulator& other);

 private:
  std::vector<Plane<double>> sum_[2];  // per half, per component
  std::vector<Plane<double>> sumsq_;
  uint64_t count_[2] = {0, 0};
};

// The alpha channel: mean coverage of the pixels, 8 bytes a pixel.
class CoverageAccumulator {
 public:
  CoverageAccumulator(int width, int height) : sum_(width, height) {}
  void commit(const PassTarget& target);
  uint64_t passes() const { return count_; }
  Plane<float> mean() const;

  // For state files: what a file holds, and back.
  const Plane<double>& sums() const { return sum_; }
  void listSums(const std::string& name, RawSums& list) { list.push_back({name, &sum_}); }
  void setCount(uint64_t passes) { count_ = passes; }
  void addCount(const CoverageAccumulator& other) { count_ += other.count_; }

 private:
  Plane<double> sum_;
  uint64_t count_ = 0;
};

}  // namespace braid
