// SPDX-License-Identifier: Apache-2.0
#include "combiners/ensemble/scales/error_scale.h"

#include <algorithm>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kAround = 4;           // radius in pixels of the geometric mean about a pixel
constexpr double kOwnOffset = 0.01;  // of logarithms, so that black counts as dark
constexpr double kAroundOffset = 0.03;
constexpr int kNear = 2;         // radius in pixels of what about a pixel both halves show
constexpr double kMostRoot = 3;  // times that of all samples

using Images = std::vector<const Rgb<float>*>;

double brightness(const Rgb<float>& image, size_t i) {
  const double sum =
      static_cast<double>(image[0][i]) + static_cast<double>(image[1][i]) + static_cast<double>(image[2][i]);
  return std::max(0.0, sum / 3);
}

double root(float level) {
  const double l = static_cast<double>(level);
  return 1 / std::sqrt(l * l + 0.01);
}

// The level of one image of every candidate.
Plane<float> commonLevel(const Images& images) {
  const int width = images[0]->width(), height = images[0]->height();
  const double count = static_cast<double>(images.size());
  Plane<float> own(width, height, kUnfilled), mean(width, height, kUnfilled), logarithm(width, height, kUnfilled);
  parallelChunks(own.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double sum = 0, logs = 0;
      for (const Rgb<float>* image : images) {
        const double b = brightness(*image, i);
        sum += b;
        logs += std::log(b + kOwnOffset);
      }
      own[i] = finiteFloat(std::exp(logs / count) - kOwnOffset);
      mean[i] = finiteFloat(sum / count);
      logarithm[i] = finiteFloat(std::log(sum / count + kAroundOffset));
    }
  });
  const Plane<float> near = boxMean<float>(mean, 1), around = boxMean<float>(logarithm, kAround);
  parallelChunks(own.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double geometric = std::exp(static_cast<double>(around[i])) - kAroundOffset;
      own[i] = std::max(own[i], std::min(near[i], finiteFloat(geometric)));
    }
  });
  return own;
}

}  // namespace

Plane<float> commonErrorRoots(const std::vector<const Estimate*>& candidates) {
  Images all, ofA, ofB;
  for (const Estimate* e : candidates) {
    all.push_back(&e->mean);
    ofA.push_back(&e->half[0]);
    ofB.push_back(&e->half[1]);
  }
  Plane<float> level = commonLevel(all);
  const Plane<float> a = commonLevel(ofA), b = commonLevel(ofB);
  const Plane<float> aboutA = boxMean<float>(a, kNear), aboutB = boxMean<float>(b, kNear);
  parallelChunks(level.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float about = std::min({level[i], aboutA[i], aboutB[i]});
      const double ofBoth = root(std::max(about, std::min(a[i], b[i])));
      level[i] = static_cast<float>(std::min(ofBoth, kMostRoot * root(level[i])));
    }
  });
  return level;
}

}  // namespace braid
