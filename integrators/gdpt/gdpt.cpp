// SPDX-License-Identifier: Apache-2.0
// Gradient-domain path tracing: every pass estimates the image and its differences between neighbouring pixels, and a
// screened Poisson equation finds the image that fits both (integrators/README.md, Gradient-domain path tracing).
//
// Each pass is reconstructed by itself. The solution is linear in what was sampled, so halves, quarters and variances
// come out as for any other integrator. A pass may be negative.
//
// What the camera sees directly is kept out of the equation, and pixels in which a few rays ahead of the render met the
// background only keep their path-traced value: that choice does not depend on any pass, so it biases nothing.
#include "integrators/gdpt/gdpt_kernel.h"
#include "integrators/gdpt/gdpt_poisson.h"
#include "integrators/registry.h"
#include "integrators/tiles.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x67647074, kBackgroundStream = 0x67647075;
constexpr double kScreening = 0.2;
constexpr int kBackgroundRays = 4;

// Which pixels of the window see nothing but background.
struct BackgroundPixels : Preparation {
  Plane<uint8_t> background;

  BackgroundPixels(const TransportContext& context, const Plan& plan)
      : background(plan.window.width(), plan.window.height(), 1) {
    Plan probe = plan;
    probe.settings.maxDepth = 1;
    probe.kept.features = false;
    for (int ray = 0; ray < kBackgroundRays; ++ray) {
      // Points of one bucket are stratified over the pixel.
      const PassSampler sampler(SamplerKind::Sobol, plan.settings.seed, kBackgroundStream,
                                static_cast<uint64_t>(ray) * kSequenceBuckets, 1);
      forEachTile({context, probe}, [&](const PixelWindow& tile, std::vector<RecordedRay>*) {
        markCovered(context, probe, sampler, tile);
        return TileCounts();
      });
    }
  }

 private:
  void markCovered(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
                   const PixelWindow& tile) {
    PathKernel kernel(context, plan, sampler, nullptr);
    for (int y = tile.y0; y < tile.y1; ++y) {
      kernel.clear();
      for (int x = tile.x0; x < tile.x1; ++x) kernel.start(x, y, sampler.itemKey(pixelItem(plan, x, y)));
      kernel.run();
      for (int x = tile.x0; x < tile.x1; ++x)
        if (kernel.sample(x - tile.x0).coverage > 0) background.at(x - plan.window.x0, y - plan.window.y0) = 0;
    }
  }
};

// What one pass samples. A rejected sample has zeros but for `direct`, which keeps its value for the film to reject.
struct PassSamples {
  Rgb<float> base, direct, difference[kNeighbours];

  PassSamples(int width, int height) : base(width, height), direct(width, height) {
    for (Rgb<float>& d : difference) d = Rgb<float>(width, height);
  }
  void set(size_t i, const GradientSample& sample, float clamp);
  double rightHandSide(size_t c, int x, int y) const;
};

Spectrum limited(const Spectrum& value, float clamp) {
  const float largest = maxComponent(glm::abs(value));
  return clamp > 0 && largest > clamp ? value * (clamp / largest) : value;
}

void PassSamples::set(size_t i, const GradientSample& sample, float clamp) {
  const Spectrum whole = sample.path.radiance + sample.direct;
  bool ok = isFinite(whole) && minComponent(whole) >= 0;
  for (const Spectrum& d : sample.difference) ok = ok && isFinite(d);
  if (!ok) {
    direct.set(i, Spectrum(std::numeric_limits<float>::quiet_NaN()));
    return;
  }
  // The limit holds for the whole path, as in the path tracer, and for each difference.
  const Spectrum kept = limited(whole, clamp);
  const float share = maxComponent(whole) > 0 ? maxComponent(kept) / maxComponent(whole) : 1.0f;
  base.set(i, sample.path.radiance * share);
  direct.set(i, sample.direct * share);
  for (size_t j = 0; j < kNeighbours; ++j) difference[j].set(i, limited(sample.difference[j], clamp));
}

// α² P - div G at a pixel. A difference g from x to its neighbour y adds -g to the equation of x and g to that of y;
// both pixels sampled their share of it.
double PassSamples::rightHandSide(size_t c, int x, int y) const {
  double b = kScreening * kScreening * static_cast<double>(base[c].at(x, y));
  for (int j = 0; j < kNeighbours; ++j) {
    const int nx = x + kNeighbourX[j], ny = y + kNeighbourY[j];
    if (nx < 0 || ny < 0 || nx >= base.width() || ny >= base.height()) continue;
    b += static_cast<double>(difference[j ^ 1][c].at(nx, ny)) - static_cast<double>(difference[j][c].at(x, y));
  }
  return b;
}

// Replaces the sampled image by the reconstructed one.
void reconstruct(PassSamples& samples, const Plane<uint8_t>& background) {
  const int width = samples.base.width(), height = samples.base.height();
  for (size_t c = 0; c < 3; ++c) {
    Plane<double> image(width, height);
    parallelRows(height, [&](int y) {
      for (int x = 0; x < width; ++x) image.at(x, y) = samples.rightHandSide(c, x, y);
    });
    solveScreenedPoisson(image, kScreening);
    parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        if (!background[i]) samples.base[c][i] = static_cast<float>(image[i]);
    });
  }
}

class GradientDomainPathTracer final : public Integrator {
 public:
  const char* name() const override { return "gdpt"; }
  const char* description() const override {
    return "gradient-domain path tracing with L2 reconstruction of every pass";
  }
  Correlation correlation() const override { return Correlation::Gradients; }
  bool mayBeNegative() const override { return true; }
  Applies applies(const SceneTraits&, const LightReach&) const override {
    return {false, "several paths for each of the path tracer's: for smooth scenes, when named"};
  }
  double misses(const LightReach& reach) const override { return reach.beyondCameraPaths; }
  WorkingMemory workingMemory(const Plan& plan) const override {
    const auto pixels = static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height());
    constexpr uint64_t kSampled = 3 * sizeof(float) * (2 + kNeighbours), kSolved = 2 * sizeof(double);
    return {pixels * (kSampled + kSolved + 1), "for the differences of a pass between pixels and their reconstruction"};
  }
  std::shared_ptr<const Preparation> prepare(const TransportContext& context, const Plan& plan) const override {
    return std::make_shared<BackgroundPixels>(context, plan);
  }

  bool renderPass(const PassRequest& request, PassTarget& target) const override {
    PassSamples samples(request.plan.window.width(), request.plan.window.height());
    if (!samplePass(request, samples, target)) return false;
    std::unique_ptr<const BackgroundPixels> own;
    auto prepared = dynamic_cast<const BackgroundPixels*>(request.preparation);
    if (!prepared) {
      own = std::make_unique<BackgroundPixels>(request.context, request.plan);
      prepared = own.get();
    }
    cancellable(request.cancel, [&] { reconstruct(samples, prepared->background); });
    if (request.cancel && request.cancel->load()) return false;
    store(request, samples, target);
    return true;
  }

 private:
  static bool samplePass(const PassRequest& request, PassSamples& samples, PassTarget& target);
  static void store(const PassRequest& request, const PassSamples& samples, PassTarget& target);
};

bool GradientDomainPathTracer::samplePass(const PassRequest& request, PassSamples& samples, PassTarget& target) {
  const Plan& plan = request.plan;
  const PassSampler sampler(plan.settings.sampler, plan.settings.seed, kStream, request.pass);
  return forEachTile(request, [&](const PixelWindow& tile, std::vector<RecordedRay>* record) {
    GradientKernel kernel(request.context, plan, sampler, record);
    forEachBatch(
        tile,
        [&](int i, int x, int y) {
          if (i == 0) kernel.clear();
          kernel.start(x, y, sampler.itemKey(pixelItem(plan, x, y)));
        },
        [&] { kernel.run(); },
        [&](int i, int frameX, int frameY) {
          const GradientSample& sample = kernel.sample(i);
          const int x = frameX - plan.window.x0, y = frameY - plan.window.y0;
          samples.set(samples.base[0].index(x, y), sample, plan.settings.clamp);
          if (plan.kept.features) target.features(x, y, sample.path.features);
          if (target.wantsCoverage()) target.coverage(x, y, sample.path.coverage);
        });
    return TileCounts{pixelCount(tile), kernel.rayCount, kernel.shadowRayCount};
  });
}

void GradientDomainPathTracer::store(const PassRequest& request, const PassSamples& samples, PassTarget& target) {
  const PixelWindow& window = request.plan.window;
  parallelRows(window.height(), [&](int y) {
    for (int x = 0; x < window.width(); ++x) {
      const size_t i = samples.base[0].index(x, y);
      if (!target.addSigned(x, y, samples.base.pixel(i) + samples.direct.pixel(i)) && request.statistics)
        request.statistics->rejectedPixel =
            static_cast<int64_t>(y + window.y0) * request.plan.settings.width + (x + window.x0);
    }
  });
}

}  // namespace

std::unique_ptr<Integrator> make_gdpt() { return std::make_unique<GradientDomainPathTracer>(); }

}  // namespace braid
