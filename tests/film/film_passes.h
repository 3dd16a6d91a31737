// SPDX-License-Identifier: Apache-2.0
// Films filled with passes, and averages of their images.
#pragma once

#include <cstring>
#include <random>

#include "renderer/film/film.h"

namespace braid::test::film_passes {

inline bool sameBits(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (a[c].size() != b[c].size() || std::memcmp(a[c].data.data(), b[c].data.data(), 4 * a[c].size()) != 0)
      return false;
  return true;
}

inline double average(const Rgb<float>& image) {
  double sum = 0;
  for (const Plane<float>& p : image.channel)
    for (float v : p.data) sum += static_cast<double>(v);
  return sum / static_cast<double>(3 * image.size());
}

// Passes of independent uniform variates in [0, 1).
inline Accumulator uniformPasses(int width, int height, int buckets, uint64_t passes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u;
  Accumulator film(width, height, buckets);
  PassTarget target(width, height, {});
  for (uint64_t pass = 0; pass < passes; ++pass) {
    target.clear();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) target.add(x, y, Spectrum(u(random), u(random), u(random)));
    film.commit(pass, target);
  }
  return film;
}

}  // namespace braid::test::film_passes
