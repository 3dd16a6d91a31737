// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/lost_light.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "combiners/pixels/box_mean.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/pixels/likeness.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr int kRadius = 60, kShareRadius = 30;  // of windows, and of the means of |d|² and V that a share is found by
constexpr double kLeastSamples = 12;
constexpr double kMostGain = 4;
constexpr double kStandsOut = 3;
constexpr double kDark = 1e-6;  // of images of order 1

double valueOf(const Rgb<float>& image, size_t c, size_t i) { return static_cast<double>(image[c][i]); }

double brightness(const Rgb<float>& image, size_t i) {
  return (valueOf(image, 0, i) + valueOf(image, 1, i) + valueOf(image, 2, i)) / 3;
}

// What counts of a pixel. One that stands out may be a lamp: nothing if it stands out from other surfaces, else what
// only one half of x shows.
double whatCounts(const Estimate& image, const Estimate& x, const Features* features, int column, int row) {
  const size_t i = image.mean[0].index(column, row);
  const double before = brightness(image.mean, i);
  if (!(brightness(x.mean, i) > kStandsOut * before)) return 1;
  if (features && !isAlike(*features, column, row)) return 0;
  const double a = brightness(x.half[0], i) - before, b = brightness(x.half[1], i) - before;
  return a > 0 && b > 0 ? 1 - 2 * std::sqrt(a * b) / (a + b) : 1;
}

Plane<float> allThatCounts(const Estimate& image, const Estimate& x, const Features* features) {
  Plane<float> counts(image.mean.width(), image.mean.height(), kUnfilled);
  parallelRows(counts.height, [&](int row) {
    for (int column = 0; column < counts.width; ++column)
      counts.at(column, row) = static_cast<float>(whatCounts(image, x, features, column, row));
  });
  return counts;
}

// Means over windows of value(i), in an image of the size of another plane.
template <class Value>
Plane<float> windowMean(const Plane<float>& size, const Value& value) {
  Plane<float> values(size.width, size.height, kUnfilled);
  parallelChunks(values.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) values[i] = finiteFloat(value(i));
  });
  return boxMean<float>(values, kRadius);
}

// Pixels of the window about one, within the image.
double windowPixels(int x, int y, int width, int height) {
  const int columns = std::min(width - 1, x + kRadius) - std::max(0, x - kRadius) + 1;
  const int rows = std::min(height - 1, y + kRadius) - std::max(0, y - kRadius) + 1;
  return static_cast<double>(columns) * rows;
}

// Of every window: light of the image, what of that of x is lost, and the share of it that stands out of its noise.
struct LostLight {
  std::array<Plane<float>, 3> level, lost;
  Plane<float> share;
};

// |d|² and V, relative to the brightness of the window, become shares: 1 - k V / |d|².
void relateToBrightness(const LostLight& of, Plane<float>& distance, Plane<float>& noise) {
  parallelRows(noise.height, [&](int row) {
    for (int column = 0; column < noise.width; ++column) {
      const size_t i = noise.index(column, row);
      double squares = 0, brightness = kDark;
      for (size_t c = 0; c < 3; ++c) {
        squares += static_cast<double>(of.lost[c][i]) * static_cast<double>(of.lost[c][i]);
        brightness += static_cast<double>(of.level[c][i]) / 3;
      }
      const double scale = 1 / (brightness * brightness);
      distance[i] = finiteFloat(squares * scale);
      noise[i] =
          finiteFloat(static_cast<double>(noise[i]) * scale / windowPixels(column, row, noise.width, noise.height));
    }
  });
}

LostLight lostLight(const Rgb<float>& image, const Rgb<float>& x, const Rgb<float>& variance,
                    const Plane<float>& counts) {
  LostLight out;
  for (size_t c = 0; c < 3; ++c) {
    out.level[c] = windowMean(counts, [&](size_t i) { return valueOf(image, c, i); });
    out.lost[c] = windowMean(
        counts, [&](size_t i) { return static_cast<double>(counts[i]) * (valueOf(x, c, i) - valueOf(image, c, i)); });
  }
  Plane<float> noise = windowMean(counts, [&](size_t i) {
    const double sum = valueOf(variance, 0, i) + valueOf(variance, 1, i) + valueOf(variance, 2, i);
    return sum * static_cast<double>(counts[i]) * static_cast<double>(counts[i]);
  });
  Plane<float> distance(noise.width, noise.height, kUnfilled);
  relateToBrightness(out, distance, noise);
  distance = boxMean<float>(distance, kShareRadius);
  noise = boxMean<float>(noise, kShareRadius);
  out.share = Plane<float>(noise.width, noise.height, 0.0f);
  parallelChunks(noise.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double d = static_cast<double>(distance[i]);
      if (!(d > 0)) continue;
      out.share[i] = static_cast<float>(std::max(0.0, 1 - kLeastSamples * static_cast<double>(noise[i]) / d));
    }
  });
  return out;
}

// Multiplies an image by its gain; whether that is above 1 anywhere.
bool giveBack(Rgb<float>& image, const LostLight& of) {
  std::atomic<bool> any = false;
  parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
    bool here = false;
    for (size_t c = 0; c < 3; ++c)
      for (size_t i = begin; i < end; ++i) {
        const double level = static_cast<double>(of.level[c][i]);
        if (!(of.share[i] > 0) || !(level > 0)) continue;
        const double gain = 1 + static_cast<double>(of.share[i]) * static_cast<double>(of.lost[c][i]) / level;
        image[c][i] = finiteFloat(valueOf(image, c, i) * std::clamp(gain, 1.0, kMostGain));
        here = here || gain > 1;
      }
    if (here) any = true;
  });
  return any;
}

}  // namespace

std::optional<Estimate> withLostLight(const Estimate& image, const Estimate& x, const Features* features) {
  const Plane<float> counts = allThatCounts(image, x, features);
  Estimate out;
  out.mean = image.mean;
  if (!giveBack(out.mean, lostLight(image.mean, x.mean, x.variance, counts))) return std::nullopt;
  for (size_t h = 0; h < 2; ++h) {
    out.half[h] = image.half[h];
    giveBack(out.half[h], lostLight(image.half[h], x.half[h], x.variance, counts));
  }
  return out;
}

}  // namespace braid
