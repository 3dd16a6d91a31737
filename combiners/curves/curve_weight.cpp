// SPDX-License-Identifier: Apache-2.0
#include "combiners/curves/curve_weight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace braid {

namespace {

constexpr double kSteepest = -2, kFlattest = -0.25;
constexpr size_t kMostPoints = 8;

}  // namespace

double ConvergenceCurve::passesAt(double error) const { return std::exp((std::log(error) - intercept) / slope); }

std::optional<ConvergenceCurve> fitCurve(std::span<const CurvePoint> points, size_t most, double prior) {
  std::array<double, kMostPoints> x, y;
  const size_t limit = std::min(most, kMostPoints);
  size_t count = 0;
  for (size_t k = points.size(); k-- > 0 && count < limit; ++count) {
    const CurvePoint& p = points[k];
    if (!(p.variance > 0 && p.passes > 0)) break;
    if (count > 0 && !(p.variance > points[k + 1].variance && p.passes < points[k + 1].passes)) break;
    x[count] = std::log(p.passes);
    y[count] = std::log(p.variance);
  }
  if (count < 2) return {};
  double meanX = 0, meanY = 0, xx = 0, xy = 0;
  for (size_t k = 0; k < count; ++k) {
    meanX += x[k] / static_cast<double>(count);
    meanY += y[k] / static_cast<double>(count);
  }
  for (size_t k = 0; k < count; ++k) {
    xx += (x[k] - meanX) * (x[k] - meanX);
    xy += (x[k] - meanX) * (y[k] - meanY);
  }
  ConvergenceCurve curve;
  curve.slope = std::clamp((xy - prior) / (xx + prior), kSteepest, kFlattest);
  curve.intercept = meanY - curve.slope * meanX;
  if (!std::isfinite(curve.slope) || !std::isfinite(curve.intercept)) return {};
  return curve;
}

ConvergenceCurve curveOfSlope(const CurvePoint& point, double slope) {
  return {slope, std::log(point.variance) - slope * std::log(point.passes)};
}

double denoisedWeight(std::span<const CurvePoint> history, const CurvePoint& now, double error, double epsilon,
                      const CurveSettings& settings, const WeightLimits& limits) {
  const CurvePoint last{now.passes, now.variance + epsilon};
  const double risk = error + epsilon;
  const double most = std::min(limits.most, limits.mostRatio * now.passes);
  // Without variance there is nothing to gain from the denoised image.
  if (!(now.variance > 0 && last.variance > 0 && now.passes > 0)) return 0;
  if (!(risk > 0)) return most;
  std::optional<ConvergenceCurve> curve = fitCurve(history, settings.points, settings.slopePrior);
  if (!curve) curve = curveOfSlope(last, settings.fallbackSlope);
  const double w = curve->passesAt(risk);
  return w == w ? std::clamp(w, 0.0, most) : 0.0;
}

double independentError(double v, double m, double q, double share) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!(v > 0 && v < kInfinity && m < kInfinity) || q != q) return m;
  const double bound = std::sqrt(v) * std::sqrt(m), covariance = std::clamp(q, -bound, bound);
  if (share * covariance >= m) return 0;
  return covariance < v ? v * ((m - share * covariance) / (v - covariance)) : kInfinity;
}

}  // namespace braid
