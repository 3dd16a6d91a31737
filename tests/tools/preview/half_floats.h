// SPDX-License-Identifier: Apache-2.0
// Half floats as a preview sends them.
#pragma once

#include <cmath>
#include <limits>
#include <string>

namespace braid::test::half_floats {

// IEEE 754 binary16, little-endian.
inline float halfAt(const std::string& bytes, size_t index) {
  const auto byte = [&](size_t i) { return static_cast<unsigned>(static_cast<unsigned char>(bytes.at(i))); };
  const unsigned bits = byte(2 * index) | byte(2 * index + 1) << 8;
  const int exponent = static_cast<int>(bits >> 10 & 31);
  const auto fraction = static_cast<double>(bits & 1023);
  const double size = exponent == 31  ? (fraction > 0 ? std::nan("") : std::numeric_limits<double>::infinity())
                      : exponent == 0 ? std::ldexp(fraction, -24)
                                      : std::ldexp(1 + fraction / 1024, exponent - 15);
  return static_cast<float>(bits & 32768 ? -size : size);
}

}  // namespace braid::test::half_floats
