// SPDX-License-Identifier: Apache-2.0
// Vectors of floats as wide as the instruction set the file is compiled for, by the vector extension of gcc and clang.
// Sums over pixels that are kept in lanes depend on that width in their last bits, never on the number of threads.
#pragma once

#include <cstdint>
#include <cstring>

namespace braid {

#if defined(__AVX512F__)
inline constexpr int kLanes = 16;
#elif defined(__AVX__)
inline constexpr int kLanes = 8;
#else
inline constexpr int kLanes = 4;
#endif

using FloatLanes = float __attribute__((vector_size(kLanes * 4)));
using IntLanes = int32_t __attribute__((vector_size(kLanes * 4)));

inline FloatLanes loadLanes(const float* p) {
  FloatLanes v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}

inline void storeLanes(float* p, FloatLanes v) { std::memcpy(p, &v, sizeof(v)); }

// Keeps a loaded vector in a register: gcc 12 would read it from memory again at every use, and the processor wait for
// its loads (combiners/EXPERIMENTS.md, Speed of inner loops).
inline void keepInRegister([[maybe_unused]] FloatLanes& v) {
#if defined(__AVX512F__)
  __asm__("" : "+v"(v));
#elif defined(__x86_64__)
  __asm__("" : "+x"(v));
#endif
}

inline FloatLanes broadcastLanes(float x) { return x - FloatLanes{}; }

inline FloatLanes maxLanes(FloatLanes a, FloatLanes b) { return a > b ? a : b; }
inline FloatLanes minLanes(FloatLanes a, FloatLanes b) { return a < b ? a : b; }

// 0, 1, 2, … by lane.
inline FloatLanes laneIndices() {
  FloatLanes v{};
  for (int l = 0; l < kLanes; ++l) v[l] = static_cast<float>(l);
  return v;
}

inline float sumLanes(FloatLanes v) {
  float sum = 0;
  for (int l = 0; l < kLanes; ++l) sum += v[l];
  return sum;
}

inline float maxOfLanes(FloatLanes v) {
  float m = v[0];
  for (int l = 1; l < kLanes; ++l) m = v[l] > m ? v[l] : m;
  return m;
}

// Whether a lane of a comparison holds.
inline bool anyLane(IntLanes comparison) {
  uint64_t words[kLanes / 2], any = 0;
  std::memcpy(words, &comparison, sizeof(words));
  for (const uint64_t w : words) any |= w;
  return any != 0;
}

inline FloatLanes sqrtLanes(FloatLanes v) {
  FloatLanes root;
  for (int l = 0; l < kLanes; ++l) root[l] = __builtin_sqrtf(v[l]);
  return root;
}

// exp(max(x, -60)) for x <= 0, to 3e-7 relative plus |x| units in the last place: as a weight, exp(-60) is nothing, and
// its products are no subnormals. Taylor series of 2^f about 0 on |f| <= 1/2, whose first omitted term is 1.2e-7, times
// a power of two put together from bits. NaN counts as -60.
inline FloatLanes expNegative(FloatLanes x) {
  constexpr float kLowest = -60.0f;
  constexpr float kShift = 12582912.0f;  // 1.5 * 2^23: adding it rounds to an integer
  const FloatLanes y = maxLanes(x, broadcastLanes(kLowest)) * 1.44269504088896f;
  const FloatLanes shifted = y + kShift;
  const FloatLanes f = y - (shifted - kShift);
  FloatLanes p = f * 1.54035304e-4f + 1.33335581e-3f;
  p = p * f + 9.61812911e-3f;
  p = p * f + 5.55041087e-2f;
  p = p * f + 2.40226507e-1f;
  p = p * f + 6.93147181e-1f;
  p = p * f + 1.0f;
  IntLanes bits, exponent;
  std::memcpy(&bits, &p, sizeof(bits));
  std::memcpy(&exponent, &shifted, sizeof(exponent));
  bits += exponent << 23;  // the shift leaves the rounded integer in the low bits; the rest falls off the top
  FloatLanes result;
  std::memcpy(&result, &bits, sizeof(result));
  return result;
}

}  // namespace braid
