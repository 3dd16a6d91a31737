// SPDX-License-Identifier: Apache-2.0
// FLIP (Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020) and HDR-FLIP ("Visualizing
// Errors in Rendered High Dynamic Range Images", 2021), from the formulas of the papers. All filters are sums of
// separable ones.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <utility>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/core/vec.h"
#include "tools/metrics/filter.h"
#include "tools/metrics/metrics.h"
#include "tools/metrics/tonemap.h"

namespace braid {

namespace {

using Taps = std::vector<float>;

constexpr float kColourExponent = 0.7f;    // q_c
constexpr float kColourKnee = 0.4f;        // p_c: fraction of the largest difference that maps to p_t
constexpr float kColourKneeValue = 0.95f;  // p_t
constexpr float kFeatureExponent = 0.5f;   // q_f
constexpr float kFeatureWidth = 0.082f;    // w, degrees
constexpr float kExposureTarget =
    0.85f;  // tone-mapped luminance of the brightest and of the median pixel at the end exposures

// One Gaussian of a contrast sensitivity function: a sqrt(pi/b) exp(-pi² d² / b), d in degrees.
struct Sensitivity {
  double a, b;
};
constexpr Sensitivity kAchromatic = {1, 0.0047}, kRedGreen = {1, 0.0053};
constexpr Sensitivity kBlueYellow[2] = {{34.1, 0.04}, {13.5, 0.025}};

// Linear Rec. 709 to CIE XYZ, relative to the white (1, 1, 1): rows divided by their sums. And back.
const Mat3& toRelativeXyz() {
  static const Mat3 matrix = [] {
    Mat3 m = glm::transpose(Mat3(0.4123908f, 0.3575843f, 0.1804808f, 0.2126390f, 0.7151687f, 0.0721923f, 0.0193308f,
                                 0.1191948f, 0.9505322f));
    for (int row = 0; row < 3; ++row) {
      const float sum = m[0][row] + m[1][row] + m[2][row];
      for (int column = 0; column < 3; ++column) m[column][row] /= sum;
    }
    return m;
  }();
  return matrix;
}

// The opponent space YCxCz: linear, so that filtering in it is filtering of light.
Vec3 opponentOf(const Vec3& rgb) {
  const Vec3 t = toRelativeXyz() * rgb;
  return Vec3(116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z));
}
Vec3 relativeXyzOf(const Vec3& opponent) {
  const float y = (opponent.x + 16) / 116;
  return Vec3(y + opponent.y / 500, y, y - opponent.z / 200);
}

// CIELAB with the Hunt effect: chroma counts less where it is dark.
Vec3 huntLab(const Vec3& relativeXyz) {
  constexpr float delta = 6.0f / 29;
  const auto f = [](float t) { return t > delta * delta * delta ? std::cbrt(t) : t / (3 * delta * delta) + 4.0f / 29; };
  const float fx = f(relativeXyz.x), fy = f(relativeXyz.y), fz = f(relativeXyz.z);
  const float lightness = 116 * fy - 16;
  return Vec3(lightness, 0.01f * lightness * 500 * (fx - fy), 0.01f * lightness * 200 * (fy - fz));
}

float hyab(const Vec3& a, const Vec3& b) { return std::fabs(a.x - b.x) + std::sqrt(sqr(a.y - b.y) + sqr(a.z - b.z)); }

// The largest colour difference that the model knows, between pure green and pure blue, after the exponent.
float largestColourDifference() {
  const Vec3 green = huntLab(toRelativeXyz() * Vec3(0, 1, 0)), blue = huntLab(toRelativeXyz() * Vec3(0, 0, 1));
  return std::pow(hyab(green, blue), kColourExponent);
}

// Compresses the differences that hardly grow in perception into [p_t, 1].
float colourError(float difference, float largest) {
  const float power = std::pow(difference, kColourExponent), knee = kColourKnee * largest;
  if (power < knee) return kColourKneeValue / knee * power;
  return kColourKneeValue + (power - knee) / (largest - knee) * (1 - kColourKneeValue);
}

// exp(-pi² d²/b) at whole pixels, and the weight of its normalised 2D filter before normalisation.
std::pair<Taps, double> sensitivityTaps(const Sensitivity& s, int radius, double pixelsPerDegree) {
  std::vector<double> raw;
  double sum = 0;
  for (int i = -radius; i <= radius; ++i) {
    raw.push_back(std::exp(-sqr(M_PI * i / pixelsPerDegree) / s.b));
    sum += raw.back();
  }
  Taps taps;
  for (double r : raw) taps.push_back(static_cast<float>(r / sum));
  return {taps, s.a * std::sqrt(M_PI / s.b) * sum * sum};
}

// The spatial filter: what the eye resolves of each opponent channel.
struct SensitivityFilter {
  explicit SensitivityFilter(double pixelsPerDegree) {
    // Three standard deviations of the widest Gaussian.
    const int radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * M_PI * M_PI)) * pixelsPerDegree));
    achromatic = sensitivityTaps(kAchromatic, radius, pixelsPerDegree).first;
    redGreen = sensitivityTaps(kRedGreen, radius, pixelsPerDegree).first;
    const auto wide = sensitivityTaps(kBlueYellow[0], radius, pixelsPerDegree);
    const auto narrow = sensitivityTaps(kBlueYellow[1], radius, pixelsPerDegree);
    blueYellow[0] = blueYellowRows[0] = wide.first;
    blueYellow[1] = blueYellowRows[1] = narrow.first;
    for (float& t : blueYellowRows[0]) t *= static_cast<float>(wide.second / (wide.second + narrow.second));
    for (float& t : blueYellowRows[1]) t *= static_cast<float>(narrow.second / (wide.second + narrow.second));
  }

  Rgb<float> apply(const Rgb<float>& opponent) const {
    Rgb<float> out;
    out[0] = filterColumns(filterRows(opponent[0], achromatic), achromatic);
    out[1] = filterColumns(filterRows(opponent[1], redGreen), redGreen);
    out[2] = filterColumns(filterRows(opponent[2], blueYellowRows[0]), blueYellow[0]);
    addFilteredColumns(filterRows(opponent[2], blueYellowRows[1]), blueYellow[1], out[2]);
    return out;
  }

  Taps achromatic, redGreen, blueYellow[2], blueYellowRows[2];
};

// Scales positive taps to the sum 1 and negative ones to -1.
Taps balanced(const std::vector<double>& raw) {
  double positive = 0, negative = 0;
  for (double r : raw) (r > 0 ? positive : negative) += r;
  Taps taps;
  for (double r : raw) taps.push_back(static_cast<float>(r > 0 ? r / positive : r < 0 ? -r / negative : 0));
  return taps;
}

// Edges and points: first and second derivatives of a Gaussian as wide as an edge in focus.
struct FeatureFilter {
  explicit FeatureFilter(double pixelsPerDegree) {
    const double sigma = 0.5 * static_cast<double>(kFeatureWidth) * pixelsPerDegree;
    const int radius = static_cast<int>(std::ceil(3 * sigma));
    std::vector<double> g, g1, g2;
    for (int i = -radius; i <= radius; ++i) {
      g.push_back(std::exp(-i * i / (2 * sigma * sigma)));
      g1.push_back(-i * g.back());
      g2.push_back((i * i / (sigma * sigma) - 1) * g.back());
    }
    smooth = balanced(g);
    first = balanced(g1);
    second = balanced(g2);
  }

  // Strength of edges and of points at each pixel.
  std::pair<Plane<float>, Plane<float>> apply(const Plane<float>& luminance) const {
    const Plane<float> smoothRows = filterRows(luminance, smooth);
    const auto strength = [&](const Taps& taps) {
      Plane<float> x = filterColumns(filterRows(luminance, taps), smooth);
      const Plane<float> y = filterColumns(smoothRows, taps);
      parallelChunks(x.size(), kPixelChunk, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) x[i] = std::sqrt(sqr(x[i]) + sqr(y[i]));
      });
      return x;
    };
    return {strength(first), strength(second)};
  }

  Taps smooth, first, second;
};

// What FLIP compares of one image.
struct Perceived {
  Rgb<float> lab;              // filtered, CIELAB with the Hunt effect
  Plane<float> edges, points;  // of the unfiltered luminance
};

Perceived perceive(const Rgb<float>& display, const SensitivityFilter& eye, const FeatureFilter& features) {
  const int width = display.width(), height = display.height();
  Rgb<float> opponent(width, height);
  Plane<float> relativeLuminance(width, height);
  parallelChunks(display.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3 o = opponentOf(display.pixel(i));
      opponent.set(i, o);
      relativeLuminance[i] = (o.x + 16) / 116;
    }
  });
  Perceived p;
  p.lab = eye.apply(opponent);
  static const Mat3 toRgb = glm::inverse(toRelativeXyz());
  parallelChunks(display.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3 rgb = glm::clamp(toRgb * relativeXyzOf(p.lab.pixel(i)), 0.0f, 1.0f);
      p.lab.set(i, huntLab(toRelativeXyz() * rgb));
    }
  });
  std::tie(p.edges, p.points) = features.apply(relativeLuminance);
  return p;
}

// Keeps the larger of the error so far and the error between the two images.
void maximise(const Perceived& a, const Perceived& r, Plane<float>& error) {
  static const float largest = largestColourDifference();
  parallelChunks(error.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float colour = colourError(hyab(a.lab.pixel(i), r.lab.pixel(i)), largest);
      const float structure = std::max(std::fabs(a.edges[i] - r.edges[i]), std::fabs(a.points[i] - r.points[i]));
      const float feature = std::pow(structure * std::sqrt(0.5f), kFeatureExponent);
      error[i] = std::max(error[i], std::pow(colour, 1 - feature));
    }
  });
}

Rgb<float> exposed(const Rgb<float>& image, float stops) {
  const float scale = std::exp2(stops);
  Rgb<float> out(image.width(), image.height());
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) out[c][i] = acesTonemap(scale * image[c][i]);
    });
  return out;
}

// The x that the tone curve maps to kExposureTarget: the positive root of a quadratic.
double exposureTargetInput() {
  const double t = static_cast<double>(kExposureTarget);
  const double a = 0.36 * (2.51 - t * 2.43), b = 0.6 * (0.03 - t * 0.59), c = -t * 0.14;
  return (-b + std::sqrt(b * b - 4 * a * c)) / (2 * a);
}

}  // namespace

std::vector<float> flipExposures(const Rgb<float>& reference) {
  // Black pixels say nothing about the exposure, and a median of zero would ask for an infinite one.
  std::vector<float> y;
  for (size_t i = 0; i < reference.size(); ++i)
    if (const float l = luminance(reference.pixel(i)); l > 0) y.push_back(l);
  if (y.empty()) return {0.0f};
  const float brightest = *std::max_element(y.begin(), y.end());
  const size_t blacks = reference.size() - y.size();
  if (2 * blacks < reference.size()) y.insert(y.end(), blacks, 0.0f);
  const auto middle = y.begin() + static_cast<std::ptrdiff_t>(y.size() / 2);
  std::nth_element(y.begin(), middle, y.end());
  double median = static_cast<double>(*middle);
  if (y.size() % 2 == 0) median = 0.5 * (median + static_cast<double>(*std::max_element(y.begin(), middle)));

  const double x = exposureTargetInput();
  const double start = std::log2(x / static_cast<double>(brightest)), stop = std::log2(x / median);
  const int count = std::max(2, static_cast<int>(std::ceil(stop - start)));
  std::vector<float> stops;
  for (int i = 0; i < count; ++i) stops.push_back(static_cast<float>(start + (stop - start) * i / (count - 1)));
  return stops;
}

Plane<float> ldrFlip(const Rgb<float>& image, const Rgb<float>& reference, float pixelsPerDegree) {
  const SensitivityFilter eye(static_cast<double>(pixelsPerDegree));
  const FeatureFilter features(static_cast<double>(pixelsPerDegree));
  Plane<float> error(image.width(), image.height());
  maximise(perceive(image, eye, features), perceive(reference, eye, features), error);
  return error;
}

Plane<double> hdrFlipErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  // 0.7 m from a screen 0.7 m wide with 3840 pixels.
  const double pixelsPerDegree = 0.7 * (3840 / 0.7) * (M_PI / 180);
  const SensitivityFilter eye(pixelsPerDegree);
  const FeatureFilter features(pixelsPerDegree);
  Plane<float> error(image.width(), image.height());
  for (float stops : flipExposures(reference))
    maximise(perceive(exposed(image, stops), eye, features), perceive(exposed(reference, stops), eye, features), error);
  Plane<double> out(error.width, error.height);
  std::copy(error.data.begin(), error.data.end(), out.data.begin());
  return out;
}

}  // namespace braid
