// SPDX-License-Identifier: Apache-2.0
// Sums of floats in whole numbers, without rounding, to compare the film's with.
#pragma once

#include <cmath>
#include <cstdint>

namespace braid::test::exact_sums {

// Exact sums of floats that are multiples of 2^-bits and below 2^(56 - bits): at most 2^24 of them fit.
class ExactSums {
 public:
  explicit ExactSums(int bits) : scale_(std::ldexp(1.0, bits)), bits_(bits) {}
  void add(float v) {
    const auto k = static_cast<int64_t>(static_cast<double>(v) * scale_);
    representable_ &= static_cast<double>(k) == static_cast<double>(v) * scale_;
    sum_ += k;
    squares_ += static_cast<Wide>(k) * k;
    ++count_;
  }
  bool representable() const { return representable_; }
  // The quotients are exact but for the roundings of the last division.
  long double mean() const { return std::ldexp(static_cast<long double>(sum_) / count(), -bits_); }
  // Σ (v - mean)² / (n (n - 1)), from n Σ k² - (Σ k)², which is exact.
  long double varianceOfMean() const {
    const Wide spread = static_cast<Wide>(count_) * squares_ - sum_ * sum_;
    return std::ldexp(static_cast<long double>(spread) / (count() * count() * (count() - 1)), -2 * bits_);
  }

 private:
  __extension__ using Wide = __int128;
  long double count() const { return static_cast<long double>(count_); }
  double scale_;
  int bits_;
  Wide sum_ = 0, squares_ = 0;
  uint64_t count_ = 0;
  bool representable_ = true;
};

}  // namespace braid::test::exact_sums
