// SPDX-License-Identifier: Apache-2.0
// Collaborative first-order regression (combiners/README.md, Regression): the engine of James-Stein's optimised biased
// image, of the radiance prior of double shrinkage and of NFOR.
//
// About every centre c a colour is fitted as a linear function of features, x ≈ b0 + Σ_k b_k (f_k - f_k(c)), by
// weighted least squares over a square window that is clipped at the borders. Every pixel i then averages the
// predictions of the models about it:
//   out_i = (Σ_c w(c,i) x̂_c(i) + fallbackWeight * fallback_i) / (Σ_c w(c,i) + fallbackWeight).
// Models sit at every stride-th pixel in x and y. Without the fallback a stride is harmful: thin geometry and glints
// that resemble no strided centre would get the average of strangers.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "renderer/core/plane.h"
#include "renderer/film/estimates.h"

namespace braid {

// The weights of the pixels of a window. A pure function, called from many threads, for every pair of a centre and a
// row of its window: once to fit and once to reconstruct.
class WindowWeights {
 public:
  virtual ~WindowWeights() = default;
  // Writes out[0, x1 - x0): the weights, finite and >= 0, of the pixels [x0, x1) of row y in the window about (cx, cy).
  // `out` has room for kRowSlack more values, which may be overwritten with anything: vector code need not stop short.
  virtual void row(int cx, int cy, int y, int x0, int x1, float* out) const = 0;

  static constexpr int kRowSlack = 16;
};

// One to three feature planes that share one scale, e.g. the components of a normal.
using FeatureGroup = std::vector<const Plane<float>*>;

// One weighted sum of squares: Σ_i w(c,i) |target_i - model_c(i)|². Several are fitted by one model together.
struct RegressionTerm {
  const Rgb<float>* target = nullptr;
  const WindowWeights* weights = nullptr;
  const Rgb<float>* secondTarget = nullptr;  // of regressTwo(): another image on the same features and weights
};

struct RegressionInputs {
  std::vector<FeatureGroup> features;  // at most kMaxFeatures planes; pixel offsets may be given as coordinate planes
  std::vector<RegressionTerm> terms;   // at least one
  const WindowWeights* reconstruction = nullptr;  // null: those of the first term
  const Rgb<float>* fallback = nullptr;           // zero-order value of every pixel
  const Rgb<float>* secondFallback = nullptr;     // of regressTwo()

  static constexpr int kMaxFeatures = 23;
};

enum class Ridge {
  Absolute,        // `ridge` on the whole diagonal, the intercept included (James-Stein, released code)
  RelativeToTrace  // ridge * trace / size, on all but the intercept
};

struct RegressionSettings {
  int radius = 25;           // windows of (2 radius + 1)² pixels
  int stride = 4;            // distance of model centres in pixels; 1: a model for every pixel
  float fallbackWeight = 2;  // in units of the weight of one model that fits exactly; 0: only where no model reaches
  // Pixels whose sum of weights over all models is below this get a model of their own, with the weight that models at
  // every pixel would have had on a grid of this stride: (sum of the weights of its window) / stride². 0: none do.
  float ownModelBelow = 0;
  // Divides every feature group by (its largest distance from the centre in the window + scaleOffset), so that one
  // ridge suits all units (James-Stein, released code); negative: features as they are.
  float scaleOffset = 0.1f;
  Ridge ridgeKind = Ridge::Absolute;
  double ridge = 0.1;
  const std::atomic<bool>* cancel = nullptr;
};

// James-Stein and double shrinkage, whose windows are so large that the fallback, biased as it may be, must weigh
// little: as much as one pixel that looks the same. Pixels that fewer than eight such pixels speak for get their own
// model.
RegressionSettings stridedSettings(int stride, const std::atomic<bool>* cancel);

// What went wrong, and how nearly.
struct RegressionReport {
  uint64_t models = 0;
  uint64_t ownModels = 0;       // of them, models of single pixels
  uint64_t raisedRidge = 0;     // models whose matrix needed a larger ridge to be positive definite
  uint64_t constantModels = 0;  // models that no ridge saved: replaced by the weighted mean
  uint64_t fallbackPixels = 0;  // pixels that no model reached (weights below 1e-5): the fallback alone
  double maxCondition = 0;      // largest estimate (square of the ratio of the extreme Cholesky pivots), ridge included

  RegressionReport& operator+=(const RegressionReport& other);
  // The counts in words, for the header of an image.
  Attribute attribute(const std::string& name) const;
};

// Centres along an axis of `size` pixels: centreCount() of them, the k-th at centrePosition().
int centreCount(int size, int stride);
int centrePosition(int k, int size, int stride);

// The reconstructed image. All planes have one size. The same bits for any number of threads.
Rgb<float> regress(const RegressionInputs& inputs, const RegressionSettings& settings,
                   RegressionReport* report = nullptr);

// The images of `target` and of `secondTarget`, bit for bit what two calls give, for about 1.3 times the cost of one.
std::array<Rgb<float>, 2> regressTwo(const RegressionInputs& inputs, const RegressionSettings& settings,
                                     RegressionReport* report = nullptr);

}  // namespace braid
