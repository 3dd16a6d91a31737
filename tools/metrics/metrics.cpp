// SPDX-License-Identifier: Apache-2.0
#include "tools/metrics/metrics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <strings.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "tools/metrics/tonemap.h"

namespace braid {

namespace {

constexpr double kInfiniteError = std::numeric_limits<double>::infinity();

// Errors of pixels that depend on the two pixels alone.
template <class Error>
Plane<double> perPixel(const Rgb<float>& image, const Rgb<float>& reference, const Error& error) {
  Plane<double> out(image.width(), image.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      double a[3], r[3];
      for (size_t c = 0; c < 3; ++c) {
        a[c] = static_cast<double>(image[c][i]);
        r[c] = static_cast<double>(reference[c][i]);
      }
      out[i] = error(a, r);
    }
  });
  return out;
}

Plane<double> mseErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  return perPixel(image, reference, [](const double* a, const double* r) {
    return (sqr(a[0] - r[0]) + sqr(a[1] - r[1]) + sqr(a[2] - r[2])) / 3;
  });
}

Plane<double> relL2Errors(const Rgb<float>& image, const Rgb<float>& reference) {
  return perPixel(image, reference, [](const double* a, const double* r) {
    const double mean = (r[0] + r[1] + r[2]) / 3;
    return (sqr(a[0] - r[0]) + sqr(a[1] - r[1]) + sqr(a[2] - r[2])) / (3 * (sqr(mean) + 0.01));
  });
}

Plane<double> relMseErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  return perPixel(image, reference, [](const double* a, const double* r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += sqr(a[c] - r[c]) / (sqr(r[c]) + 0.01);
    return sum / 3;
  });
}

Plane<double> smapeErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  return perPixel(image, reference, [](const double* a, const double* r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += std::fabs(a[c] - r[c]) / (std::fabs(a[c]) + std::fabs(r[c]) + 0.001);
    return sum / 3;
  });
}

Plane<double> displayMseErrors(const Rgb<float>& image, const Rgb<float>& reference) {
  return perPixel(image, reference, [](const double* a, const double* r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      const float da = displayValue(static_cast<float>(a[c])), dr = displayValue(static_cast<float>(r[c]));
      sum += sqr(static_cast<double>(da) - static_cast<double>(dr));
    }
    return sum / 3;
  });
}

double psnrOf(double mse) { return 10 * std::log10(1 / mse); }
double ssimOf(double dssim) { return 1 - 2 * dssim; }

bool finiteAt(const Rgb<float>& image, size_t i) { return isFinite(image.pixel(i)); }

// Mean of the errors of the pixels in `use` without the `trimPercent` largest.
double trimmedMean(const Plane<double>& errors, const std::vector<char>& use, uint64_t used, double trimPercent) {
  if (used == 0) return 0;
  const auto removed = std::min(static_cast<uint64_t>(static_cast<double>(used) * trimPercent / 100), used - 1);
  double limit = std::numeric_limits<double>::infinity();
  if (removed > 0) {
    std::vector<double> sorted;
    sorted.reserve(used);
    for (size_t i = 0; i < errors.size(); ++i)
      if (use[i]) sorted.push_back(errors[i]);
    const auto last = sorted.begin() + static_cast<std::ptrdiff_t>(used - removed - 1);
    std::nth_element(sorted.begin(), last, sorted.end());
    limit = *last;
  }
  // Errors below the largest one that stays are summed in pixel order, so that the result does not depend on how the
  // rest was sorted.
  struct Sum {
    double value = 0;
    uint64_t count = 0;
    void operator+=(const Sum& s) { value += s.value, count += s.count; }
  };
  const Sum below = parallelSum(errors.size(), kPixelChunk, Sum{}, [&](size_t begin, size_t end) {
    Sum s;
    for (size_t i = begin; i < end; ++i)
      if (use[i] && errors[i] < limit) s += {errors[i], 1};
    return s;
  });
  const uint64_t kept = used - removed;
  const double atLimit = kept > below.count ? limit * static_cast<double>(kept - below.count) : 0.0;
  return (below.value + atLimit) / static_cast<double>(kept);
}

bool sameName(const char* a, const std::string& b) { return ::strcasecmp(a, b.c_str()) == 0; }

}  // namespace

const std::vector<Metric>& metricRegistry() {
  static const std::vector<Metric> table = {
      {"relL2", "relative squared error: mean of (I-R)^2 / (mean_RGB(R)^2 + 0.01)", false, relL2Errors, nullptr},
      {"relMSE", "relative squared error per channel: mean of (I-R)^2 / (R^2 + 0.01)", false, relMseErrors, nullptr},
      {"MSE", "mean of (I-R)^2 over pixels and channels", false, mseErrors, nullptr},
      {"SMAPE", "mean of |I-R| / (|I| + |R| + 0.001)", false, smapeErrors, nullptr},
      {"PSNR", "10 log10(1 / MSE) in dB of the tone-mapped images (ACES, sRGB); larger is better", true,
       displayMseErrors, psnrOf},
      {"DSSIM", "(1 - SSIM) / 2, mean over the channels of the tone-mapped images", false, dssimErrors, nullptr},
      {"SSIM", "structural similarity of the tone-mapped images (ACES, sRGB); larger is better", true, dssimErrors,
       ssimOf},
      {"FLIP", "HDR-FLIP: perceived difference when flipping between the images, maximum over exposures", false,
       hdrFlipErrors, nullptr},
  };
  return table;
}

const Metric* findMetric(const std::string& name) {
  for (const Metric& m : metricRegistry())
    if (sameName(m.name, name)) return &m;
  return nullptr;
}

MetricResult evaluate(const Metric& metric, const Rgb<float>& image, const Rgb<float>& reference, double trimPercent) {
  BRAID_ASSERT(image.width() == reference.width() && image.height() == reference.height() && !image.empty());
  MetricResult result;
  std::vector<char> use(image.size(), 1);
  for (size_t i = 0; i < use.size(); ++i)
    if (!finiteAt(reference, i)) {
      use[i] = 0;
      ++result.excluded;
    } else if (!finiteAt(image, i)) {
      ++result.invalid;
    }
  const uint64_t used = image.size() - result.excluded;
  double mean = kInfiniteError;
  if (result.invalid == 0 && result.excluded == 0) {
    mean = trimmedMean(metric.errors(image, reference), use, used, trimPercent);
  } else if (result.invalid == 0) {
    // Metrics with windows look at neighbours: excluded pixels are black in both images.
    Rgb<float> a = image, r = reference;
    for (size_t i = 0; i < use.size(); ++i)
      if (!use[i]) {
        a.set(i, Vec3(0));
        r.set(i, Vec3(0));
      }
    mean = used > 0 ? trimmedMean(metric.errors(a, r), use, used, trimPercent) : kInfiniteError;
  }
  result.value = metric.finish ? metric.finish(mean) : mean;
  return result;
}

double metric(const std::string& name, const Rgb<float>& image, const Rgb<float>& reference) {
  const Metric* m = findMetric(name);
  if (!m) {
    std::string names;
    for (const Metric& known : metricRegistry()) names += (names.empty() ? "" : ", ") + std::string(known.name);
    throw Error(ExitCode::Usage, "unknown metric '" + name + "'; known are " + names);
  }
  return evaluate(*m, image, reference).value;
}

}  // namespace braid
