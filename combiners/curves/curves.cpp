// SPDX-License-Identifier: Apache-2.0
// Blending by convergence curves (combiners/README.md, Convergence curves): every pixel and channel is
//   out = (I n + W d) / (I + W),
// where I is the number of passes of the noisy image n, and W the number at which it will be as good as the denoised
// image d. The denoised image fades as the render converges. Options bring the paper back; what they gain:
// combiners/EXPERIMENTS.md, Small risks of curves; Relative maps of curves; Lone fireflies first.
//
// Earlier variances are filtered with the width of the newest, so that the curve of a pixel describes one region. Where
// denoising has stopped, d is that of the noisy image of that time, and W never exceeds its value then: to let it grow,
// by its limits or by the noise of the curve, would bring the old image back.
#include <algorithm>
#include <cmath>

#include "combiners/curves/curve_weight.h"
#include "combiners/curves/sure_blend.h"
#include "combiners/pipeline/denoise_cutoff.h"
#include "combiners/statistics/variance.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/curves/sure_map_filter.h"
#include "combiners/pipeline/registry.h"
#include "combiners/shrinkage/shrinkage.h"
#include "combiners/statistics/sure_map.h"
#include "renderer/core/parallel.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kStep = sureStepOption("curves");
const OptionInfo kSlope{
    "curves-fallback-slope", -1, "Slope of pixels without a curve; -2: the paper, -1: theory", -2, -0.25, false};
const OptionInfo kSlopePrior{
    "curves-slope-prior", 8, "Weight of the slope -1 beside the points of a curve; 0: the paper", 0, 1e6, false};
const OptionInfo kPoints{"curves-points", 4, "Most points of a curve, 2 to 8; fewer: all pixels take the fallback", 0,
                         8};
const OptionInfo kMost{"curves-most", 65536, "Most passes that a denoised pixel counts", 0, 1e15};
const OptionInfo kGate{"curves-gate", 1, "1: lone fireflies of the noisy image do not count; 0: the paper"};
const OptionInfo kRelative{"curves-relative", 1, "1: pixels of a map count by their relative error; 0: the paper"};
const OptionInfo kPool{"curves-pool", 1, "1: risks hidden by noise are those of wider windows; 0: the paper"};
const OptionInfo kCovariance{"curves-covariance", 1, "1: noise that both images share counts; 0: the paper"};
const OptionInfo kMostRatio{
    "curves-most-ratio", 64, "Most passes that it counts, per pass of the noisy image", 0, 1e9, false};

// Before, variances are too uncertain for a curve.
constexpr double kFewestPasses = 16;
constexpr double kRelativeEpsilon = 1e-6;

class Curves : public StoppingMethod {
 public:
  explicit Curves(uint64_t stop = 0) : stop_(stop) {}
  const char* name() const override { return "curves"; }
  const char* description() const override { return "Denoised image that fades as the noisy one converges (SURE)"; }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = needs.redenoise = true;
    needs.checkpoints = 2;
    needs.halves = false;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override {
    if (of.passes > 0 && of.passes < 4) return {108, 44};
    return {144, 44, 0, 36};
  }
  std::vector<OptionInfo> options() const override {
    return {kStep, kSlope, kSlopePrior, kPoints, kMost, kMostRatio, kCurvesStop, kGate, kRelative, kPool, kCovariance};
  }
  uint64_t stop() const override { return stop_; }
  std::unique_ptr<Method> stoppedAfter(uint64_t passes) const override {
    return std::make_unique<Curves>(stopPasses(static_cast<double>(passes)));
  }
  MethodResult run(const MethodInputs& in) const override;

 private:
  uint64_t stop_;
};

// Filtered variances of an estimate, for the curves of all pixels.
struct Variances {
  double passes = 0;
  Rgb<float> newest;
  std::vector<double> earlierPasses;  // oldest first
  std::vector<Rgb<float>> earlier;
};

Variances variancesOf(const MethodInputs& in, const Estimate& n, const SureMapFilter& filter, size_t points) {
  Variances v;
  v.passes = static_cast<double>(passesOf(n));
  v.newest = filter(n.variance);
  if (!in.history || points < 2 || v.passes < kFewestPasses) return v;
  // The last points - 1 states between one pass, which has no variance, and the newest.
  std::vector<const Checkpoint*> kept;
  for (const Checkpoint& k : *in.history)
    if (k.passes >= 2 && static_cast<double>(k.passes) < v.passes && k.variance.size() == n.mean.size())
      kept.push_back(&k);
  for (size_t k = kept.size() - std::min(kept.size(), points - 1); k < kept.size(); ++k) {
    v.earlierPasses.push_back(static_cast<double>(kept[k]->passes));
    v.earlier.push_back(filter(kept[k]->variance));
  }
  return v;
}

// 10⁻⁶ of the mean variance of a channel.
double epsilonOf(const Plane<float>& variance) {
  const double sum = parallelSum<double>(variance.size(), kPixelChunk, 0, [&](size_t begin, size_t end) {
    double part = 0;
    for (size_t i = begin; i < end; ++i) part += static_cast<double>(variance[i]);
    return part;
  });
  return variance.empty() ? 0 : kRelativeEpsilon * sum / static_cast<double>(variance.size());
}

// W of all pixels of a channel, for the error of the denoised image.
Plane<float> weightsOf(const Variances& v, const Plane<float>& error, size_t c, const MethodOptions& options,
                       size_t points) {
  const CurveSettings settings{std::clamp(options.number(kSlope), -2.0, -0.25),
                               std::max(0.0, options.number(kSlopePrior)), points};
  const double epsilon = epsilonOf(v.newest[c]);
  const WeightLimits limits{std::max(0.0, options.number(kMost)), std::max(0.0, options.number(kMostRatio))};
  Plane<float> out(v.newest.width(), v.newest.height());
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    std::vector<CurvePoint> curve(v.earlier.size() + 1);
    for (size_t i = begin; i < end; ++i) {
      for (size_t k = 0; k < v.earlier.size(); ++k)
        curve[k] = {v.earlierPasses[k], static_cast<double>(v.earlier[k][c][i])};
      const CurvePoint now{v.passes, static_cast<double>(v.newest[c][i])};
      curve.back() = now;
      out[i] = finiteFloat(denoisedWeight(curve, now, static_cast<double>(error[i]), epsilon, settings, limits));
    }
  });
  return out;
}

// independentError() of all pixels.
Plane<float> independentErrors(const Plane<float>& v, const Plane<float>& m, const Plane<float>& q, double share) {
  Plane<float> out(v.width, v.height);
  parallelChunks(out.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      out[i] = finiteFloat(
          independentError(static_cast<double>(v[i]), static_cast<double>(m[i]), static_cast<double>(q[i]), share));
  });
  return out;
}

// The squared error of n + a (d - n), for the covariance q of both errors, no larger than it can be.
double blendError(double v, double m, double q, double a) {
  const double bound = std::sqrt(v * m);
  return std::max(0.0, (1 - a) * (1 - a) * v + a * a * m + 2 * a * (1 - a) * std::clamp(q, -bound, bound));
}

// What is known of the pixels before they are blended.
struct Evidence {
  SureMaps sure;  // of the denoised image, filtered
  Variances now, atStop;
  bool stopped = false;     // denoising has, and there is an atStop
  double sharedPasses = 1;  // the share of those that were denoised in all
};

Evidence evidenceOf(const MethodInputs& in, const SureMapFilter& filter, size_t points) {
  const Estimate &n = *in.unbiased, &source = in.stopped ? *in.stopped : n;
  Evidence e;
  SureMaps maps = denoisedSureMaps(in, source, kStep);
  e.sure = {filter.risk(std::move(maps.risk), source.variance), filter(std::move(maps.covariance))};
  e.now = variancesOf(in, n, filter, points);
  e.stopped = in.stopped != nullptr;
  if (e.stopped) e.atStop = variancesOf(in, source, filter, points);
  e.sharedPasses = static_cast<double>(passesOf(source)) / std::max(1.0, e.now.passes);
  return e;
}

// W of all pixels of a channel.
Plane<float> channelWeights(const Evidence& e, size_t c, const MethodOptions& options, size_t points) {
  const Plane<float>&m = e.sure.risk[c], &q = e.sure.covariance[c];
  const Plane<float>& v = (e.stopped ? e.atStop : e.now).newest[c];
  const auto weightsAt = [&](const Variances& at, double passesShared) {
    if (options.number(kCovariance) == 0) return weightsOf(at, m, c, options, points);
    return weightsOf(at, independentErrors(v, m, q, passesShared), c, options, points);
  };
  Plane<float> weight = weightsAt(e.now, e.sharedPasses);
  if (!e.stopped) return weight;
  const Plane<float> most = weightsAt(e.atStop, 1);
  for (size_t i = 0; i < weight.size(); ++i) weight[i] = std::min(weight[i], most[i]);
  return weight;
}

void blendChannel(const Evidence& e, const Plane<float>& weight, const Plane<float>& gate, size_t c, SureBlend& blend) {
  parallelChunks(weight.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double w = static_cast<double>(weight[i]);
      const bool firefly = isLoneFirefly(gate, blend.noisy.mean, blend.denoised.mean, i);
      const double a = firefly ? 1.0 : w / (e.now.passes + w);
      blend.set(c, i, [a](float noisy, float denoised) {
        return finiteFloat((1 - a) * static_cast<double>(noisy) + a * static_cast<double>(denoised));
      });
      const double error = blendError(static_cast<double>(e.now.newest[c][i]), static_cast<double>(e.sure.risk[c][i]),
                                      e.sharedPasses * static_cast<double>(e.sure.covariance[c][i]), a);
      blend.result.error[i] += finiteFloat(error / 3);
      blend.share[i] += static_cast<float>(a / 3);
    }
  });
}

MethodResult Curves::run(const MethodInputs& in) const {
  const Estimate& source = in.stopped ? *in.stopped : *in.unbiased;
  const auto points = static_cast<size_t>(std::clamp(in.options.number(kPoints), 0.0, 8.0));
  const bool pooled = in.options.number(kPool) != 0;
  const double sigma = pooled ? kBoxSigma : sureMapFilterSigma(source.variance);
  const SureMapFilter filter(sigma, in.options.number(kRelative) != 0 ? &in.biased->mean : nullptr, pooled);
  const Evidence evidence = evidenceOf(in, filter, points);
  const Plane<float> gate =
      in.options.number(kGate) != 0 ? fireflyGate(in.unbiased->variance, kGateRadius) : Plane<float>();
  SureBlend blend(in);
  for (size_t c = 0; c < 3; ++c)
    blendChannel(evidence, channelWeights(evidence, c, in.options, points), gate, c, blend);
  MethodResult result = blend.finish(name(), sigma);
  const auto count = [&](const char* key, size_t value) {
    result.remarks.push_back(wholeAttribute(key, static_cast<int64_t>(value)));
  };
  count("curvePoints", evidence.now.earlier.size() + 1);
  if (in.stopped) count("stoppedAfter", source.passes);
  return result;
}

}  // namespace

uint64_t stopPasses(double number) {
  constexpr double kFewestStop = 2, kMostStop = 1e12;
  return number >= 1 ? static_cast<uint64_t>(std::clamp(number, kFewestStop, kMostStop)) : 0;
}

std::unique_ptr<Method> make_curves() { return std::make_unique<Curves>(); }

}  // namespace braid
