// SPDX-License-Identifier: Apache-2.0
// The choice of the instruction set for loops over float arrays.
#pragma once

namespace braid {

#if defined(__x86_64__) && defined(__GNUC__)
#define BRAID_AVX512 "avx512f,avx512bw,avx512dq,avx512vl"
#if defined(__clang__)
#define BRAID_WIDE ""
#else
#define BRAID_WIDE ",prefer-vector-width=512"
#endif
template <class Body>
__attribute__((target(BRAID_AVX512 BRAID_WIDE), flatten, noinline)) void runWithAvx512(const Body& b) {
  b();
}
template <class Body>
__attribute__((target("avx2"), flatten, noinline)) void runWithAvx2(const Body& b) {
  b();
}
#undef BRAID_AVX512
#undef BRAID_WIDE
#endif

// The instruction set that runVectorised() uses on this processor.
enum class VectorLevel { Baseline, Avx2, Avx512 };
inline VectorLevel vectorLevel() {
#if defined(__x86_64__) && defined(__GNUC__)
  static const VectorLevel level = [] {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl"))
      return VectorLevel::Avx512;
    return __builtin_cpu_supports("avx2") ? VectorLevel::Avx2 : VectorLevel::Baseline;
  }();
  return level;
#else
  return VectorLevel::Baseline;
#endif
}

// Calls body() in the widest instruction set of this processor: everything that it calls and the compiler sees is
// compiled for each. The results have the same bits in all of them as long as body() does nothing but float arithmetic
// without contraction (-ffp-contract=off).
template <class Body>
void runVectorised(const Body& body) {
#if defined(__x86_64__) && defined(__GNUC__)
  if (vectorLevel() == VectorLevel::Avx512) return runWithAvx512(body);
  if (vectorLevel() == VectorLevel::Avx2) return runWithAvx2(body);
#endif
  body();
}

}  // namespace braid
