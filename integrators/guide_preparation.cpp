// SPDX-License-Identifier: Apache-2.0
#include "integrators/guide_preparation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "integrators/guiding/guide_photons.h"
#include "integrators/guiding/pixel_grid.h"
#include "integrators/path_kernel.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kStream = 0x6775696465;
// Frames with fewer pixels cost less to render than to learn for.
constexpr uint64_t kFewestPixels = 16384;
// The grid has about a pixel for every 16 of the frame, within these bounds.
constexpr uint64_t kFewestPlaces = 2048, kMostPlaces = 4096;

// Passes over the grid. The first ones find where light is at all; unguided ones are what guided ones have to beat.
struct Round {
  int passes;
  bool guided;
};
constexpr Round kRounds[] = {{2, false}, {4, true}, {2, false}, {4, true}};
constexpr int kPasses = 12;
constexpr ShareRange kLearning{0.25f, 0.75f};

// Guided paths must promise so many times less variance x cost.
constexpr double kPays = 1.05;
// Below this after the first guided round, shares that are fitted do not make up for it.
constexpr double kHopeless = 0.9;
// Where light that comes straight from lamps is more than this share of the variance, there is nothing to promise.
constexpr double kMostDirect = 0.85;
// Of a shadow ray and of a guided vertex, in rays.
constexpr double kShadowCost = 0.4, kGuidedCost = 0.5;
// Samples above this many times their pixel's brightness count as that.
constexpr double kMostRelative = 32;

uint64_t places(const Settings& s) {
  const uint64_t pixels = static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height);
  return std::clamp(pixels / 16, kFewestPlaces, kMostPlaces);
}

struct Cost {
  uint64_t rays = 0, shadowRays = 0, guided = 0;
  Cost& operator+=(const Cost& o) {
    rays += o.rays;
    shadowRays += o.shadowRays;
    guided += o.guided;
    return *this;
  }
  double sum() const {
    return static_cast<double>(rays) + kShadowCost * static_cast<double>(shadowRays) +
           kGuidedCost * static_cast<double>(guided);
  }
};

class Training {
 public:
  Training(const TransportContext& context, const Plan& plan)
      : context_(context), plan_(plan), grid_(plan.settings, places(plan.settings)) {}

  void run(const Round& round) {
    const size_t pixels = grid_.size(), first = pass_.size();
    for (int k = 0; k < round.passes; ++k) pass_.push_back({round.guided, std::vector<Sample>(pixels), {}});
    std::vector<PassSampler> samplers;
    for (int k = 0; k < round.passes; ++k)
      samplers.emplace_back(SamplerKind::Independent, plan_.settings.seed, kStream, first + static_cast<size_t>(k));
    const size_t chunks = (pixels + kBatch - 1) / kBatch;
    std::vector<std::vector<GuideRecord>> found(chunks);
    std::vector<std::vector<Cost>> costs(chunks);
    parallelChunks(pixels, kBatch, [&](size_t begin, size_t end) {
      const auto recorder = std::make_unique<PathRecorder>();
      for (size_t k = 0; k < samplers.size(); ++k)
        costs[begin / kBatch].push_back(
            trace(samplers[k], pass_[first + k], {begin, end}, *recorder, found[begin / kBatch]));
    });
    size_t more = 0;
    for (const std::vector<GuideRecord>& f : found) more += f.size();
    records_.reserve(records_.size() + more);
    for (size_t c = 0; c < chunks; ++c) {
      records_.insert(records_.end(), found[c].begin(), found[c].end());
      for (size_t k = 0; k < costs[c].size(); ++k) pass_[first + k].cost += costs[c][k];
    }
  }

  void learn(const ShareRange& shares) {
    if (photons_.empty()) photons_ = traceGuidePhotons(context_, plan_);
    guide_ = learnGuide(photons_, records_, scales(), shares);
  }
  const Guide& guide() const { return guide_; }
  Guide take() { return std::move(guide_); }

  // How many times less variance x cost the last `guided` guided passes have than all unguided ones.
  double gain(int guided) const {
    const double with = inefficiency(true, guided);
    return with > 0 ? inefficiency(false, kPasses) / with : 0;
  }
  // Share of direct light in the variance of unguided paths.
  double directShare() const {
    const std::vector<const Pass*> passes = of(false, kPasses);
    const double all = variance(passes, [](const Sample& s) { return s.value; });
    return all > 0 ? variance(passes, [](const Sample& s) { return s.direct; }) / all : 1;
  }
  size_t paths() const { return pass_.size() * grid_.size(); }

 private:
  struct Sample {
    float value, direct;
  };
  struct Pass {
    bool guided;
    std::vector<Sample> sample;
    Cost cost;
  };
  struct Chunk {
    size_t begin, end;
  };

  Cost trace(const PassSampler& sampler, Pass& pass, Chunk chunk, PathRecorder& recorder,
             std::vector<GuideRecord>& found) const {
    PathKernel kernel(context_, plan_, sampler, nullptr);
    kernel.use({.guide = pass.guided ? &guide_ : nullptr});
    kernel.teach(&recorder);
    recorder.begin();
    for (size_t i = chunk.begin; i < chunk.end; ++i)
      kernel.start(grid_.x(i), grid_.y(i), sampler.itemKey(pixelItem(plan_, grid_.x(i), grid_.y(i))));
    kernel.run();
    for (size_t i = chunk.begin; i < chunk.end; ++i) {
      const auto k = static_cast<int>(i - chunk.begin);
      const PathSample& s = kernel.sample(k);
      const float value = average(s.radiance);
      pass.sample[i] = std::isfinite(value) ? Sample{value, average(s.direct)} : Sample{0, 0};
      recorder.finish(k, s.radiance, static_cast<uint32_t>(i), found);
    }
    return {kernel.rayCount, kernel.shadowRayCount, kernel.guidedCount};
  }

  // Mean over pixels of the relative variance of one path, times the cost of a pass; of the last passes of a kind.
  double inefficiency(bool guided, int last) const {
    Cost cost;
    std::vector<const Pass*> passes = of(guided, last);
    for (const Pass* p : passes) cost += p->cost;
    return variance(passes, [](const Sample& s) { return s.value; }) * cost.sum() / static_cast<double>(passes.size());
  }

  std::vector<const Pass*> of(bool guided, int last) const {
    std::vector<const Pass*> passes;
    for (auto p = pass_.rbegin(); p != pass_.rend() && static_cast<int>(passes.size()) < last; ++p)
      if (p->guided == guided) passes.push_back(&*p);
    return passes;
  }

  // For each pixel 1 / its brightness, the mean over its surroundings.
  std::vector<float> scales() const {
    std::vector<double> mean(grid_.size(), 0.0);
    for (size_t i = 0; i < mean.size(); ++i)
      for (const Pass& p : pass_) mean[i] += static_cast<double>(p.sample[i].value) / static_cast<double>(pass_.size());
    return grid_.inverseBrightness(mean);
  }

  template <class Part>
  double variance(const std::vector<const Pass*>& passes, const Part& part) const {
    const std::vector<float> scale = scales();
    const auto n = static_cast<double>(passes.size());
    double total = 0;
    for (size_t i = 0; i < grid_.size(); ++i) {
      double sum = 0, squares = 0;
      for (const Pass* p : passes) {
        const double v = std::min(static_cast<double>(part(p->sample[i]) * scale[i]), kMostRelative);
        sum += v;
        squares += v * v;
      }
      total += (squares - sum * sum / n) / (n - 1);
    }
    return total / static_cast<double>(grid_.size());
  }

  const TransportContext& context_;
  const Plan& plan_;
  const PixelGrid grid_;
  std::vector<Pass> pass_;
  std::vector<GuidePhoton> photons_;
  std::vector<GuideRecord> records_;
  Guide guide_;
};

// All rounds, or as many as it takes to see that nothing will come of it.
PlanLine train(Training& training, const Settings& settings) {
  const bool forced = settings.guiding == Guiding::On;
  const auto line = [](bool kept, std::string reason) { return PlanLine{kept, "path guiding", std::move(reason)}; };
  for (const Round& round : kRounds) {
    training.run(round);
    const bool first = &round == kRounds;
    if (const double direct = first && !forced ? training.directShare() : 0; direct > kMostDirect)
      return line(false,
                  fmt::format("direct light is {:.0f} % of the variance of {} paths", 100 * direct, training.paths()));
    if (round.guided && training.gain(round.passes) < kHopeless && !forced) break;
    if (round.guided || first) training.learn(&round == std::end(kRounds) - 1 ? ShareRange{} : kLearning);
  }
  const double gain = training.gain(std::end(kRounds)[-1].passes);
  if (!forced && gain < kPays)
    return line(false, fmt::format("variance x cost would be {:.2f} times less by {} paths: {} times would pay", gain,
                                   training.paths(), kPays));
  const Guide& guide = training.guide();
  return line(true, fmt::format("variance x cost is {:.2f} times less, by {} paths: {} regions, {:.1f} MiB", gain,
                                training.paths(), guide.regions(), static_cast<double>(guide.bytes()) / 1048576.0));
}

}  // namespace

Applies guidingApplies(const Plan& plan) {
  const Settings& s = plan.settings;
  if (s.guiding == Guiding::Off) return {false, "on request"};
  if (s.maxDepth < 3) return {false, "paths scatter once at most"};
  if (s.guiding == Guiding::On) return {true, "on request"};
  // TRAP: trial passes are independent. These points serve unguided paths so much better than guided ones, whose
  // choices cut their patterns up, that a promise by independent ones is not kept.
  if (s.sampler == SamplerKind::Sobol)
    return {false,
            "with Sobol' points it costs more than it gains on most scenes (--guiding on, or --sampler independent)"};
  if (static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height) < kFewestPixels)
    return {false,
            fmt::format("the frame has fewer than {} pixels: learning would cost more than them", kFewestPixels)};
  return {true, ""};
}

uint64_t guidingBytes(const Plan& plan) {
  // Of a record: itself, its copy while it is sorted, and the same of its part of the last round; the guide.
  constexpr uint64_t kRecordBytes = 2 * sizeof(GuideRecord) + 32;
  return PixelGrid(plan.settings, places(plan.settings)).size() * kPasses * PathRecorder::kMostVertices * kRecordBytes +
         kMostGuidePhotons * 2 * sizeof(GuidePhoton);
}

GuidePreparation::GuidePreparation(const TransportContext& context, const Plan& plan) {
  if (!guidingApplies(plan).yes) return;
  Training training(context, plan);
  decisions_ = {train(training, plan.settings)};
  if (decisions_[0].kept) guide_ = training.take();
}

}  // namespace braid
