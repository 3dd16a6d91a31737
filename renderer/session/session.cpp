// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/session.h"

#include <bit>
#include <chrono>

#include <tbb/task_arena.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

class Clock {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

template <class P, class Get>
FeaturePlanes<P> featurePlanes(const Get& get) {
  return {get([](const FeatureAccumulator& a, int c) { return a.mean(c); }),
          {get([](const FeatureAccumulator& a, int c) { return a.halfMean(c, 0); }),
           get([](const FeatureAccumulator& a, int c) { return a.halfMean(c, 1); })},
          get([](const FeatureAccumulator& a, int c) { return a.variance(c); })};
}

Features collectFeatures(const FeatureAccumulator& a) {
  const auto rgb = [&](int first) {
    return [&a, first](auto plane) {
      Rgb<float> planes;
      for (int c = 0; c < 3; ++c) planes[static_cast<size_t>(c)] = plane(a, first + c);
      return planes;
    };
  };
  const auto single = [&](int component) { return [&a, component](auto plane) { return plane(a, component); }; };
  return {featurePlanes<Rgb<float>>(rgb(0)), featurePlanes<Rgb<float>>(rgb(3)), featurePlanes<Plane<float>>(single(6)),
          featurePlanes<Plane<float>>(single(7))};
}

}  // namespace

const char* toString(StopReason reason) {
  return reason == StopReason::Samples ? "samples" : reason == StopReason::Time ? "time" : "cancelled";
}

Session::Session(const Scene& scene, Plan plan)
    : scene_(scene), plan_(std::move(plan)), context_(scene, plan_.settings.lightStrategy) {
  if (plan_.integrators.empty()) throw Error(ExitCode::Usage, "no integrator to run: name one with --integrator");
  for (size_t i = 0; i < plan_.integrators.size(); ++i)
    accumulators_.emplace_back(plan_.window.width(), plan_.window.height(), plan_.buckets,
                               plan_.integrators[i].integrator->estimatesBias());
  seconds_.assign(plan_.integrators.size(), 0.0);
  if (plan_.features) features_ = std::make_unique<FeatureAccumulator>(plan_.window.width(), plan_.window.height());
  if (plan_.settings.transparent)
    coverage_ = std::make_unique<CoverageAccumulator>(plan_.window.width(), plan_.window.height());
}

RenderResult Session::run(const ProgressCallback& progress, const std::atomic<bool>* cancel,
                          const std::atomic<bool>* abandon) {
  const Settings& settings = plan_.settings;
  PassStatistics statistics;
  RenderResult result;
  tbb::task_arena arena(settings.threads > 0 ? settings.threads : tbb::task_arena::automatic);
  arena.execute([&] {
    bool splats = false, bias = false;
    for (const PlannedIntegrator& p : plan_.integrators) {
      splats = splats || p.integrator->splats();
      bias = bias || p.integrator->estimatesBias();
    }
    PassTarget target(plan_.window.width(), plan_.window.height(), splats, plan_.features, plan_.settings.transparent,
                      bias);
    const Clock clock;
    std::vector<std::shared_ptr<const Preparation>> preparations;
    for (size_t i = 0; i < plan_.integrators.size(); ++i) {
      const Clock preparing;
      preparations.push_back(plan_.integrators[i].integrator->prepare(context_, plan_));
      seconds_[i] += preparing.seconds();
    }
    const auto isSet = [](const std::atomic<bool>* flag) { return flag && flag->load(); };
    for (;;) {
      if (settings.spp > 0 && result.rounds >= settings.spp) break;
      if (settings.seconds > 0 && clock.seconds() >= settings.seconds && result.rounds > 0) {
        result.reason = StopReason::Time;
        break;
      }
      bool abandoned = false;
      for (size_t i = 0; i < plan_.integrators.size() && !abandoned; ++i) {
        const Clock passClock;
        for (int k = 0; k < plan_.integrators[i].passesPerRound && !abandoned; ++k) {
          const uint64_t pass = accumulators_[i].passes();
          target.clear();
          abandoned = !plan_.integrators[i].integrator->renderPass(
              {context_, plan_, pass, abandon, &statistics, nullptr, preparations[i].get()}, target);
          if (abandoned) break;
          const int64_t rejected = statistics.rejectedPixel.load();
          if (rejected >= 0 && !result.firstRejected)
            result.firstRejected = {plan_.integrators[i].integrator->name(), pass,
                                    static_cast<int>(rejected % settings.width),
                                    static_cast<int>(rejected / settings.width)};
          accumulators_[i].commit(pass, target);
          if (i == 0 && features_) features_->commit(pass, target);
          if (i == 0 && coverage_) coverage_->commit(target);
        }
        seconds_[i] += passClock.seconds();
      }
      if (!abandoned) ++result.rounds;
      if (settings.history && !abandoned && std::has_single_bit(result.rounds)) keepCheckpoints();
      Progress p;
      p.round = result.rounds;
      p.rounds = settings.spp;
      p.seconds = clock.seconds();
      p.rejected = 0;
      for (const Accumulator& a : accumulators_) p.rejected += a.rejected();
      if (settings.spp > 0 && p.round > 0)
        p.secondsLeft = p.seconds / static_cast<double>(p.round) * static_cast<double>(settings.spp - p.round);
      if (settings.seconds > 0) {
        const double left = std::max(0.0, settings.seconds - p.seconds);
        p.secondsLeft = p.secondsLeft < 0 ? left : std::min(p.secondsLeft, left);
      }
      const bool goOn = !progress || progress(p);
      if (abandoned || !goOn || isSet(cancel)) {
        result.reason = StopReason::Cancelled;
        break;
      }
    }
    result.seconds = clock.seconds();
    result.estimates = snapshot();
  });
  result.paths = statistics.paths;
  result.rays = statistics.rays;
  result.shadowRays = statistics.shadowRays;
  for (const Accumulator& a : accumulators_) result.rejected += a.rejected();
  result.image = result.estimates->estimates.front().mean;
  if (coverage_) result.alpha = coverage_->mean();
  return result;
}

std::shared_ptr<const Estimates> Session::snapshot() const {
  auto e = std::make_shared<Estimates>();
  e->width = plan_.window.width();
  e->height = plan_.window.height();
  e->window = plan_.window;
  e->fullWidth = plan_.settings.width;
  e->fullHeight = plan_.settings.height;
  e->seed = plan_.settings.seed;
  for (size_t i = 0; i < plan_.integrators.size(); ++i) {
    const Accumulator& a = accumulators_[i];
    Estimate estimate;
    estimate.name = plan_.integrators[i].integrator->name();
    estimate.correlation = plan_.integrators[i].integrator->correlation();
    estimate.unbiased = plan_.integrators[i].integrator->unbiased();
    estimate.passes = a.passes();
    estimate.seconds = seconds_[i];
    estimate.rejected = a.rejected();
    estimate.mean = a.mean();
    for (int h = 0; h < 2; ++h) estimate.half[h] = a.halfMean(h);
    if (plan_.settings.quarters)
      for (int k = 0; k < 4; ++k) estimate.quarter.push_back(a.bucketMean(k));
    estimate.variance = a.variance(plan_.integrators[i].integrator->lowDiscrepancy(plan_.settings));
    if (a.keepsBias()) {
      estimate.bias = a.biasMean();
      estimate.biasVariance = a.biasVariance();
    }
    e->estimates.push_back(std::move(estimate));
  }
  if (features_) e->features = collectFeatures(*features_);
  e->history = history_;
  return e;
}

void Session::keepCheckpoints() {
  for (size_t i = 0; i < plan_.integrators.size(); ++i) {
    const Accumulator& a = accumulators_[i];
    history_[plan_.integrators[i].integrator->name()].push_back(
        {a.passes(), seconds_[i], a.variance(plan_.integrators[i].integrator->lowDiscrepancy(plan_.settings))});
  }
}

}  // namespace braid
