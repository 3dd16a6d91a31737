// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/invalid_pixels.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace braid {

namespace {

using Marks = std::vector<uint8_t>;

// A hole in a feature has at least so many valid neighbours; the border of a background has fewer.
constexpr int kMidst = 5;

uint64_t count(const Marks& marks) { return static_cast<uint64_t>(std::count(marks.begin(), marks.end(), 1)); }

// Empty when all values are finite, which is nearly always.
Marks invalidOf(std::initializer_list<const Plane<float>*> planes) {
  Marks marks;
  for (const Plane<float>* p : planes)
    for (size_t i = 0; i < p->size(); ++i) {
      if (std::isfinite((*p)[i])) continue;
      if (marks.empty()) marks.resize(p->size());
      marks[i] = 1;
    }
  return marks;
}
Marks invalidOf(const Rgb<float>& image) { return invalidOf({&image[0], &image[1], &image[2]}); }

// From the neighbours that were valid before; what has fewer than `least` of them stays marked.
void fillFromNeighbours(Plane<float>& plane, Marks& invalid, int least) {
  Marks left = invalid;
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x) {
      if (!invalid[plane.index(x, y)]) continue;
      double sum = 0;
      int valid = 0;
      for (int j = std::max(0, y - 1); j <= std::min(plane.height - 1, y + 1); ++j)
        for (int i = std::max(0, x - 1); i <= std::min(plane.width - 1, x + 1); ++i) {
          if (invalid[plane.index(i, j)]) continue;
          sum += static_cast<double>(plane.at(i, j));
          ++valid;
        }
      if (valid < least) continue;
      plane.at(x, y) = static_cast<float>(sum / valid);
      left[plane.index(x, y)] = 0;
    }
  invalid = std::move(left);
}

// The rest from the image at half the size, which is filled in the same way: at most 4/3 of the pixels in all.
void fillFromCoarser(Plane<float>& plane, const Marks& invalid) {
  if (count(invalid) == 0) return;
  if (plane.width <= 1 && plane.height <= 1) return void(plane[0] = 0);
  Plane<float> half((plane.width + 1) / 2, (plane.height + 1) / 2);
  Marks none(half.size());
  for (int y = 0; y < half.height; ++y)
    for (int x = 0; x < half.width; ++x) {
      double sum = 0;
      int valid = 0;
      for (int j = 2 * y; j < std::min(plane.height, 2 * y + 2); ++j)
        for (int i = 2 * x; i < std::min(plane.width, 2 * x + 2); ++i) {
          if (invalid[plane.index(i, j)]) continue;
          sum += static_cast<double>(plane.at(i, j));
          ++valid;
        }
      none[half.index(x, y)] = valid == 0;
      half.at(x, y) = valid > 0 ? static_cast<float>(sum / valid) : 0.0f;
    }
  fillFromNeighbours(half, none, 1);
  fillFromCoarser(half, none);
  for (int y = 0; y < plane.height; ++y)
    for (int x = 0; x < plane.width; ++x)
      if (invalid[plane.index(x, y)]) plane.at(x, y) = half.at(x / 2, y / 2);
}

void fill(Plane<float>& plane, Marks invalid) {
  if (invalid.empty()) return;
  fillFromNeighbours(plane, invalid, 1);
  fillFromCoarser(plane, invalid);
}
void fill(Rgb<float>& image, const Marks& invalid) {
  for (Plane<float>& p : image.channel) fill(p, invalid);
}

void fillFeature(Plane<float>& plane, Marks invalid) {
  if (invalid.empty()) return;
  fillFromNeighbours(plane, invalid, kMidst);
  for (size_t i = 0; i < plane.size(); ++i)
    if (invalid[i]) plane[i] = 0;
}
void fillFeature(Rgb<float>& image, const Marks& invalid) {
  for (Plane<float>& p : image.channel) fillFeature(p, invalid);
}
Marks invalidOf(const Plane<float>& plane) { return invalidOf({&plane}); }

template <class P>
void fillFeatures(FeaturePlanes<P>& f) {
  for (P* plane : {&f.mean, &f.half[0], &f.half[1], &f.variance}) fillFeature(*plane, invalidOf(*plane));
}

void copyMarked(const Rgb<float>& from, const Marks& marks, const Marks& unless, Rgb<float>& to) {
  for (size_t i = 0; i < marks.size(); ++i)
    if (marks[i] && (unless.empty() || !unless[i])) to.set(i, from.pixel(i));
}

// Mean and two halves; returns the pixels of any of them that were invalid.
Marks fillHalves(Rgb<float>& mean, Rgb<float> (&half)[2]) {
  const Marks bad[3] = {invalidOf(mean), invalidOf(half[0]), invalidOf(half[1])};
  Marks any;
  for (const Marks& b : bad) {
    if (any.empty()) any = b;
    for (size_t i = 0; i < b.size(); ++i) any[i] |= b[i];
  }
  if (any.empty()) return any;
  const bool halves = !half[0].empty() && !half[1].empty();
  if (halves) {
    copyMarked(half[1], bad[1], bad[2], half[0]);
    copyMarked(half[0], bad[2], bad[1], half[1]);
  }
  for (Rgb<float>& h : half) fill(h, invalidOf(h));
  if (!halves) return fill(mean, bad[0]), any;
  for (size_t i = 0; i < bad[0].size(); ++i)
    if (bad[0][i]) mean.set(i, 0.5f * half[0].pixel(i) + 0.5f * half[1].pixel(i));
  return any;
}

void fillQuarters(Estimate& e) {
  if (e.half[0].empty() || e.half[1].empty()) {
    for (Rgb<float>& q : e.quarter) fill(q, invalidOf(q));
    return;
  }
  for (size_t k = 0; k < e.quarter.size(); ++k) copyMarked(e.half[k % 2], invalidOf(e.quarter[k]), {}, e.quarter[k]);
}

}  // namespace

uint64_t fillInvalid(Plane<float>& plane) {
  const Marks invalid = invalidOf(plane);
  fill(plane, invalid);
  return count(invalid);
}

uint64_t fillInvalid(Rgb<float>& image) {
  const Marks invalid = invalidOf(image);
  fill(image, invalid);
  return count(invalid);
}

uint64_t fillInvalid(Estimate& e) {
  const Marks any = fillHalves(e.mean, e.half);
  fillQuarters(e);
  fillHalves(e.direct.mean, e.direct.half);
  for (Rgb<float>* image :
       {&e.variance, &e.bias, &e.biasHalf[0], &e.biasHalf[1], &e.biasVariance, &e.direct.variance, &e.indirectVariance})
    fillInvalid(*image);
  return count(any);
}

uint64_t fillInvalid(Estimates& all) {
  uint64_t filled = 0;
  for (Estimate& e : all.estimates) filled += fillInvalid(e);
  for (auto& [name, checkpoints] : all.history)
    for (Checkpoint& c : checkpoints) {
      fillHalves(c.mean, c.half);
      fillInvalid(c.variance);
    }
  filled += fillInvalid(all.reference);
  if (!all.features) return filled;
  forEachFeature(*all.features, [](auto& planes) { fillFeatures(planes); });
  return filled;
}

}  // namespace braid
