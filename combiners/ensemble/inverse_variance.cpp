// SPDX-License-Identifier: Apache-2.0
// The baseline of all combiners: every pixel is the mean of the unbiased and the biased image, weighted by the inverse
// of their estimated mean squared errors,
//   out = (m x + v y) / (v + m),
// where v is the variance of the unbiased image x and m the squared error of the biased image y, both averaged over
// channels and over a box of pixels.
//
// With halves A and B, the expectation of (y_A - x_B)² is the squared error of y_A plus the variance 2 v of x_B, for
// y_A has seen no sample of x_B. The squared error of y itself is smaller by the difference of the variances of y_A and
// y, whose estimate is (y_A - y_B)² / 4. Hence m = box(½ Σ (y_h - x_h')² - 2 v - (y_A - y_B)² / 4), not below 0.
#include "combiners/pixels/box_mean.h"
#include "combiners/pipeline/registry.h"

namespace braid {

namespace {

const OptionInfo kRadius{"inverse-variance-radius", 7, "Radius in pixels of the box that errors are averaged over", 0,
                         1000};

struct Errors {
  Plane<double> unbiased, biased;  // v and m before the box
};

Errors pixelErrors(const Estimate& x, const Estimate& y) {
  Errors e{{x.mean.width(), x.mean.height()}, {x.mean.width(), x.mean.height()}};
  parallelRows(x.mean.height(), [&](int row) {
    for (int column = 0; column < x.mean.width(); ++column) {
      const size_t i = e.unbiased.index(column, row);
      double v = 0, m = 0;
      for (size_t c = 0; c < 3; ++c) {
        const auto xa = static_cast<double>(x.half[0][c][i]), xb = static_cast<double>(x.half[1][c][i]);
        const auto ya = static_cast<double>(y.half[0][c][i]), yb = static_cast<double>(y.half[1][c][i]);
        const auto variance = static_cast<double>(x.variance[c][i]);
        v += variance / 3;
        m += (0.5 * (sqr(ya - xb) + sqr(yb - xa)) - 2 * variance - 0.25 * sqr(ya - yb)) / 3;
      }
      e.unbiased[i] = v;
      e.biased[i] = m;
    }
  });
  return e;
}

// Box means of values of either sign: the box sums keep exact zeros only for values that are not negative.
Plane<double> signedBoxMean(const Plane<double>& in, int radius) {
  Plane<double> part[2] = {{in.width, in.height}, {in.width, in.height}};
  const auto forAll = [&in](const auto& body) {
    parallelChunks(in.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) body(i);
    });
  };
  forAll([&](size_t i) { part[in[i] < 0 ? 1 : 0][i] = std::fabs(in[i]); });
  for (Plane<double>& p : part) p = boxMean(p, radius);
  forAll([&](size_t i) { part[0][i] -= part[1][i]; });
  return std::move(part[0]);
}

class InverseVariance : public Method {
 public:
  const char* name() const override { return "inverse-variance"; }
  const char* description() const override {
    return "Unbiased and biased image weighted by inverse squared errors, the baseline of combiners";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.biased = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& /*of*/) const override { return {76, 44}; }
  std::vector<OptionInfo> options() const override { return {kRadius}; }
  MethodResult run(const MethodInputs& in) const override;
};

MethodResult InverseVariance::run(const MethodInputs& in) const {
  const Estimate &x = *in.unbiased, &y = *in.biased;
  const int radius = static_cast<int>(std::clamp(in.options.number(kRadius), 0.0, 1000.0));
  const int width = x.mean.width(), height = x.mean.height();
  const Errors errors = pixelErrors(x, y);
  const Plane<double> v = boxMean(errors.unbiased, radius), m = signedBoxMean(errors.biased, radius);

  MethodResult result;
  Estimate& out = result.image;
  out.mean = out.half[0] = out.half[1] = Rgb<float>(width, height);
  result.error = Plane<float>(width, height);
  Plane<float> weight(width, height);
  parallelChunks(v.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const double vi = v[i], mi = std::max(0.0, m[i]);
      // Of two images without error the unbiased one.
      const double w = vi > 0 ? vi / (vi + mi) : 0.0;
      weight[i] = static_cast<float>(w);
      result.error[i] = static_cast<float>(w * mi);
      const auto blend = [w](float a, float b) {
        return static_cast<float>((1 - w) * static_cast<double>(a) + w * static_cast<double>(b));
      };
      for (size_t c = 0; c < 3; ++c) {
        out.mean[c][i] = blend(x.mean[c][i], y.mean[c][i]);
        for (int h = 0; h < 2; ++h) out.half[h][c][i] = blend(x.half[h][c][i], y.half[h][c][i]);
      }
    }
  });
  result.aovs.push_back({"weight.inverse-variance", std::move(weight)});
  return result;
}

}  // namespace

std::unique_ptr<Method> make_inverse_variance() { return std::make_unique<InverseVariance>(); }

}  // namespace braid
