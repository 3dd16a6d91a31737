// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/spatial_variance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "combiners/pixels/box_mean.h"
#include "combiners/pipeline/exposure.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/statistics/surface_smooth.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 4;
constexpr int kScatterRadius = 7;
constexpr float kAlbedoFloor = 0.01f;
constexpr double kFloor = 0.01;  // added to brightnesses that are divided by, of an image with middle grey at 0.18
// Of second differences of features: what is more is an edge.
constexpr float kNormalEdge = 0.1f, kAlbedoEdge = 0.05f, kDepthEdge = 0.05f;
// (E √|r|)⁴ of a normal variate r of variance 1, times what the least of four such means over a window has less.
constexpr float kRootMoment = 0.4570f * 0.90f;
// A pixel that differs from its neighbours in every direction by so many deviations, and by so much of its own value,
// is a firefly: two such pixels side by side are a lamp.
constexpr float kStandsOut = 4, kAlone = 0.75f;
constexpr float kMostNoise = 1.3f;
constexpr float kLamp = 4;           // times brighter than what is around
constexpr float kLeastShare = 0.1f;  // of a window, for a mean over it
constexpr int kStep[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};

// x0 - (x1 + x2) / 2, of variance 1.5 times that of the pixels.
float secondDifference(const Plane<float>& p, size_t i, ptrdiff_t step) {
  const size_t a = i - static_cast<size_t>(step), b = i + static_cast<size_t>(step);
  return p[i] - 0.5f * p[a] - 0.5f * p[b];
}

float squaredDifference(const Rgb<float>& image, size_t i, ptrdiff_t step) {
  float sum = 0;
  for (size_t c = 0; c < 3; ++c) sum += sqr(secondDifference(image[c], i, step));
  return sum;
}

// 1 for the pixels whose difference in a direction lies within the image and on one surface.
Plane<float> usable(int width, int height, const Features* f, const int (&step)[2]) {
  Plane<float> out(width, height);
  const ptrdiff_t offset = static_cast<ptrdiff_t>(step[1]) * width + step[0];
  parallelRows(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const bool inside =
          x >= step[0] && x + step[0] < width && y >= std::abs(step[1]) && y + std::abs(step[1]) < height;
      if (!inside) continue;
      const size_t i = out.index(x, y);
      const bool edge =
          f && (squaredDifference(f->normal.mean, i, offset) > kNormalEdge ||
                squaredDifference(f->albedo.mean, i, offset) > kAlbedoEdge ||
                std::abs(secondDifference(f->depth.mean, i, offset)) > kDepthEdge * std::abs(f->depth.mean[i]));
      out[i] = edge ? 0.0f : 1.0f;
    }
  });
  return out;
}

// What is around a pixel, of which a firefly or the edge of a lamp does not change much: the median of 3 x 3 pixels,
// but no more than a few times the geometric mean of the window. What is brighter is a lamp, small and with little
// noise.
Plane<float> brightness(const Plane<float>& x, float floor) {
  Plane<float> out(x.width, x.height, kUnfilled), logs(x.width, x.height, kUnfilled);
  parallelRows(x.height, [&](int row) {
    for (int column = 0; column < x.width; ++column) {
      std::array<float, 9> values{};
      size_t count = 0;
      for (int j = std::max(0, row - 1); j <= std::min(x.height - 1, row + 1); ++j)
        for (int i = std::max(0, column - 1); i <= std::min(x.width - 1, column + 1); ++i)
          values[count++] = std::abs(x.at(i, j));
      const auto middle = values.begin() + static_cast<ptrdiff_t>(count / 2);
      std::nth_element(values.begin(), middle, values.begin() + static_cast<ptrdiff_t>(count));
      out.at(column, row) = *middle + floor;
      logs.at(column, row) = std::log(std::abs(x.at(column, row)) + floor);
    }
  });
  const Plane<float> mean = boxMean<float>(logs, kRadius);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] = std::min(out[i], kLamp * std::exp(mean[i]));
  });
  return out;
}

// The image without the colours of surfaces, as far as they are known.
Plane<float> demodulated(const Plane<float>& image, const Plane<float>* albedo) {
  Plane<float> out = image;
  if (!albedo) return out;
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) out[i] /= std::max(0.0f, (*albedo)[i]) + kAlbedoFloor;
  });
  return out;
}

// The noise of a plane: its standard deviation over the brightness, averaged over windows, and what a pixel differs
// from its neighbours by in every direction.
struct Noise {
  Plane<float> relative;  // infinite where no difference can be taken
  Plane<float> own;       // the least |second difference|; infinite likewise
};

Noise noiseOf(const Plane<float>& x, const Plane<float> (&use)[4], float floor) {
  Noise noise{Plane<float>(x.width, x.height, kInfinity), Plane<float>(x.width, x.height, kInfinity)};
  for (size_t d = 0; d < 4; ++d) {
    const ptrdiff_t step = static_cast<ptrdiff_t>(kStep[d][1]) * x.width + kStep[d][0];
    Plane<float> roots(x.width, x.height);
    parallelChunks(roots.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (use[d][i] == 0) continue;
        const size_t a = i - static_cast<size_t>(step), b = i + static_cast<size_t>(step);
        const float r = std::abs(secondDifference(x, i, step));
        roots[i] = std::sqrt(r / ((std::abs(x[i]) + std::abs(x[a]) + std::abs(x[b])) / 3 + floor));
        noise.own[i] = std::min(noise.own[i], r);
      }
    });
    const Plane<float> mean = boxMean<float>(roots, kRadius), share = boxMean<float>(use[d], kRadius);
    parallelChunks(roots.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        if (share[i] > kLeastShare)
          noise.relative[i] = std::min(noise.relative[i], sqr(mean[i] / share[i]) / std::sqrt(1.5f * kRootMoment));
    });
  }
  return noise;
}

// Nowhere much more than in the noisiest tenth of the image: what is more are the edges of small lights.
float mostNoise(const Plane<float>& relative) {
  std::vector<float> values;
  for (const float v : relative.data)
    if (v < kInfinity) values.push_back(v);
  if (values.empty()) return 0;
  const auto tenth = values.begin() + static_cast<ptrdiff_t>(values.size() - 1 - values.size() / 10);
  std::nth_element(values.begin(), tenth, values.end());
  return kMostNoise * *tenth;
}

}  // namespace

Rgb<float> spatialVariance(const Rgb<float>& image, const Features* features) {
  const int width = image.width(), height = image.height();
  const bool hasAlbedo = features && std::any_of(features->albedo.mean[0].data.begin(),
                                                 features->albedo.mean[0].data.end(), [](float a) { return a > 0; });
  const auto floor = static_cast<float>(kFloor / exposureScale(image));
  Plane<float> use[4];
  for (size_t d = 0; d < 4; ++d) use[d] = usable(width, height, features, kStep[d]);
  Rgb<float> variance(width, height);
  for (size_t c = 0; c < 3; ++c) {
    const Plane<float>* albedo = hasAlbedo ? &features->albedo.mean[c] : nullptr;
    const Plane<float> x = demodulated(image[c], albedo), around = brightness(x, floor);
    const Noise noise = noiseOf(x, use, floor);
    const float most = mostNoise(noise.relative);
    parallelChunks(x.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        float deviation = std::min(noise.relative[i], most) * around[i];
        const float own = noise.own[i] < kInfinity ? noise.own[i] : 0.0f;
        if (own > kStandsOut * deviation && own > kAlone * std::abs(x[i])) deviation = own / std::sqrt(1.5f);
        if (albedo) deviation *= std::max(0.0f, (*albedo)[i]) + kAlbedoFloor;
        variance[c][i] = std::isfinite(deviation) ? std::min(sqr(deviation), std::numeric_limits<float>::max()) : 0.0f;
      }
    });
  }
  return variance;
}

void makeHalves(Estimate& e, uint64_t seed) {
  const int width = e.mean.width(), height = e.mean.height();
  for (Rgb<float>& half : e.half) half = Rgb<float>(width, height, kUnfilled);
  parallelChunks(e.mean.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const uint64_t key = hashCombine(hashCombine(0x68616c766573, seed), i);
      // Box and Muller 1958.
      const double u = (static_cast<double>(mix64(key) >> 11) + 0.5) * 0x1p-53,
                   v = static_cast<double>(mix64(key + 1) >> 11) * 0x1p-53;
      const double normal = std::sqrt(-2 * std::log(u)) * std::cos(2 * static_cast<double>(kPi) * v);
      for (size_t c = 0; c < 3; ++c) {
        const auto noise =
            static_cast<float>(normal * std::sqrt(static_cast<double>(std::max(0.0f, e.variance[c][i]))));
        e.half[0][c][i] = e.mean[c][i] + noise;
        e.half[1][c][i] = e.mean[c][i] - noise;
      }
    }
  });
}

Rgb<float> scatterAlongSurfaces(const Rgb<float>& image, const Features* features) {
  Rgb<float> out(image.width(), image.height(), kUnfilled);
  for (size_t c = 0; c < 3; ++c) {
    Plane<float> squares(image.width(), image.height(), kUnfilled);
    parallelChunks(squares.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) squares[i] = finiteFloat(sqr(static_cast<double>(image[c][i])));
    });
    const std::vector<Plane<float>> means = surfaceSmooth({&image[c], &squares}, features, kScatterRadius);
    parallelChunks(squares.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        out[c][i] =
            finiteFloat(std::max(0.0, static_cast<double>(means[1][i]) - sqr(static_cast<double>(means[0][i]))));
    });
  }
  return out;
}

void completeFirstPasses(Estimates& all, const Features* features) {
  for (Estimate& e : all.estimates) {
    if (!e.unbiased || e.passes != 1) continue;
    e.variance = scatterAlongSurfaces(e.mean, features);
    makeHalves(e, all.seed);
    e.quarter.clear();
    e.direct = {};
    e.passes = 0;
  }
}

}  // namespace braid
