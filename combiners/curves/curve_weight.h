// SPDX-License-Identifier: Apache-2.0
// How many samples a denoised pixel is worth, read off the curve by which the variance of the pixel fell (Denisova and
// Bocchi 2024, "Converging Algorithm-Agnostic Denoising for Monte Carlo Rendering", Eqs. 7 and 14).
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace braid {

// The variance of a pixel mean at a number of passes.
struct CurvePoint {
  double passes = 0, variance = 0;
};

// log v = slope log I + intercept.
struct ConvergenceCurve {
  double slope = -1, intercept = 0;
  // The number of passes at which the variance is `error`: W of Eq. (14).
  double passesAt(double error) const;
};

// The least squares line through the newest points, from the last one backwards for as long as older variances are
// larger and numbers of passes smaller, and both positive; at most `most` points. The slope is clamped to [-2, -1/4],
// keeping the line on the centre of the points. Nothing with fewer than two points. `points` are oldest first, and
// there are at most 8 that count. `prior` pulls the slope towards -1 like points of their own, with that sum of squared
// deviations of log I; two points that are a doubling apart have 0.24, four 2.4.
std::optional<ConvergenceCurve> fitCurve(std::span<const CurvePoint> points, size_t most, double prior = 0);

// The line of a given slope through one point. A slope of -1 is the law of Monte Carlo; the second point of the paper
// comes to -2 (combiners/README.md, Convergence curves).
ConvergenceCurve curveOfSlope(const CurvePoint& point, double slope);

struct CurveSettings {
  double fallbackSlope = -1;  // without a curve
  double slopePrior = 8;      // of fitCurve()
  size_t points = 4;          // at most
};

struct WeightLimits {
  double most = 65536;    // of W, in passes: beyond it the denoised image fades
  double mostRatio = 64;  // of W to the passes of the noisy image
};

// W of one pixel and channel, in passes, between 0 and the limits, finite: the curve at `error`. `now` is the newest
// point, its variance filtered like the error; `epsilon` is added to both, against 0/0. A pixel where both images are
// black has any weight, here 0; one that is black in the noisy image only, and without variance, has 0 as well.
double denoisedWeight(std::span<const CurvePoint> history, const CurvePoint& now, double error, double epsilon,
                      const CurveSettings& settings, const WeightLimits& limits);

// The squared error of an image that has nothing of the noise of n and is worth W passes like d: v (m - s q) / (v - q),
// for the squared error m of d, made of an n of variance v, whose error has the covariance q with that of d, when s is
// the share of these passes in those of n by now. With s = 1, the best mean of d and n has the weights v - q of d and
// m - q of n. From 0, where d has all the weight, to infinity. Covariances beyond sqrt(v m) count as that.
double independentError(double v, double m, double q, double share = 1);

}  // namespace braid
