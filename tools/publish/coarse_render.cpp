// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/coarse_render.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "renderer/core/parallel.h"
#include "renderer/film/planes.h"
#include "tools/run/alarm.h"

namespace braid {

namespace {

PixelWindow coarseWindow(const PixelWindow& w, const Settings& full, const Settings& coarse) {
  const auto x = [&](int at) { return coarsePixel(at, full.width, coarse.width); };
  const auto y = [&](int at) { return coarsePixel(at, full.height, coarse.height); };
  return {x(w.x0), y(w.y0), x(w.x1 - 1) + 1, y(w.y1 - 1) + 1};
}

// Copies the pixels of a coarse window to those of a full one that lie above them.
class Enlarger {
 public:
  Enlarger(const FilmState& coarse, const Plan& plan)
      : window_(plan.window),
        columns_(static_cast<size_t>(window_.width())),
        rows_(static_cast<size_t>(window_.height())) {
    for (size_t x = 0; x < columns_.size(); ++x)
      columns_[x] =
          coarsePixel(window_.x0 + static_cast<int>(x), plan.settings.width, coarse.fullWidth) - coarse.window.x0;
    for (size_t y = 0; y < rows_.size(); ++y)
      rows_[y] =
          coarsePixel(window_.y0 + static_cast<int>(y), plan.settings.height, coarse.fullHeight) - coarse.window.y0;
  }

  Plane<float> operator()(const Plane<float>& from) const {
    Plane<float> to(window_.width(), window_.height(), Unfilled{});
    parallelRows(to.height, [&](int y) {
      for (int x = 0; x < to.width; ++x)
        to.at(x, y) = from.at(columns_[static_cast<size_t>(x)], rows_[static_cast<size_t>(y)]);
    });
    return to;
  }
  Rgb<float> operator()(const Rgb<float>& from) const {
    Rgb<float> to;
    for (size_t c = 0; c < 3; ++c) to[c] = (*this)(from[c]);
    return to;
  }

 private:
  const PixelWindow window_;
  std::vector<int> columns_, rows_;  // of the coarse window, for each of the full one
};

}  // namespace

Plan coarsePlan(const Plan& plan, const CameraData& camera, int divisor) {
  Plan coarse = plan;
  Settings& s = coarse.settings;
  s.width = (s.width + divisor - 1) / divisor;
  s.height = (s.height + divisor - 1) / divisor;
  coarse.camera = Camera(camera, s.width, s.height);
  coarse.window = coarseWindow(plan.window, plan.settings, s);
  s.crop = coarse.window;
  if (s.photons > 0) s.photons = std::max<uint64_t>(1, s.photons / static_cast<uint64_t>(divisor * divisor));
  s.keep = {.features = s.keep.features};
  s.full = false;
  keepAlso({}, coarse);
  return coarse;
}

Estimates enlargedEstimates(const FilmState& coarse, const Plan& plan) {
  const Estimates from = estimatesOf(coarse, false);
  const Enlarger enlarged(coarse, plan);
  Estimates to;
  to.width = plan.window.width();
  to.height = plan.window.height();
  to.window = plan.window;
  to.fullWidth = plan.settings.width;
  to.fullHeight = plan.settings.height;
  to.seed = from.seed;
  Estimate e;
  static_cast<EstimateHead&>(e) = from.estimates.front();
  e.mean = enlarged(from.estimates.front().mean);
  to.estimates.push_back(std::move(e));
  if (!from.features) return to;
  to.features.emplace();
  for (size_t f = 0; f < kFeaturePlanes.size(); ++f)
    for (size_t c = 0; c < kFeaturePlanes[f].components.size(); ++c)
      featurePlane(*to.features, f, 0, c) = enlarged(featurePlane(std::as_const(*from.features), f, 0, c));
  return to;
}

std::optional<Plane<float>> enlargedAlpha(const FilmState& coarse, const Plan& plan) {
  if (!coarse.coverage) return std::nullopt;
  return Enlarger(coarse, plan)(coarse.coverage->mean());
}

CoarseRender::CoarseRender(const Scene& scene, const CameraData& camera, const Plan& plan,
                           std::function<double()> timeLeft, const std::atomic<bool>* cancel)
    : scene_(scene), camera_(camera), plan_(plan), timeLeft_(std::move(timeLeft)), cancel_(cancel) {
  Plan coarsest = coarsePlan(plan, camera, kCoarsest);
  coarsest.settings.spp = 2;
  session_ = makeSession(std::move(coarsest));
  double first = 0;
  report_ = session_->advance(
      [&](const Progress& p) {
        if (p.round == 1) first = p.seconds;
        return true;
      },
      cancel);
  // The second round is only that; the first one also pays for what is worked out once.
  round_ = report_.rounds > 1 ? report_.seconds - first : first;
  preparing_ = std::max(0.0, first - round_);
  double all = 0;
  for (const EstimateState& e : session_->state().estimates) all += e.seconds;
  if (all > 0) headlineShare_ = session_->state().estimates.front().seconds / all;
}

std::unique_ptr<Session> CoarseRender::makeSession(Plan plan) const {
  auto session = std::make_unique<Session>(scene_, std::move(plan));
  session->setTimeLeft(timeLeft_);
  return session;
}

double CoarseRender::roundSeconds(int divisor) const {
  const double finer = static_cast<double>(kCoarsest) / divisor;
  return preparing_ + round_ * finer * finer;
}

void CoarseRender::refine(double grace) {
  int divisor = 2;
  while (divisor < kCoarsest && headlineShare_ * roundSeconds(divisor) > timeLeft_()) ++divisor;
  if (divisor == kCoarsest || timeLeft_() <= 0) return;
  Plan finer = coarsePlan(plan_, camera_, divisor);
  finer.integrators.resize(1);
  std::unique_ptr<Session> session = makeSession(std::move(finer));
  std::atomic<bool> abandon{false};
  RunReport report;
  {
    const Alarm alarm(timeLeft_() + grace, [&] { abandon = true; });
    report = session->advance({}, cancel_, &abandon);
  }
  if (report.rounds == 0) return;
  session_ = std::move(session);
  report_ = report;
}

}  // namespace braid
