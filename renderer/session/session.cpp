// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/session.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/make_attribute.h"
#include "renderer/session/film_of_plan.h"
#include "renderer/session/pixel_options.h"

namespace braid {

namespace {

bool isSet(const std::atomic<bool>* flag) { return flag && flag->load(); }

}  // namespace

const char* toString(StopReason reason) {
  switch (reason) {
    case StopReason::Samples:
      return "samples";
    case StopReason::Time:
      return "time";
    case StopReason::Error:
      return "error";
    case StopReason::Cancelled:
      break;
  }
  return "cancelled";
}

// One run: what lasts as long as the pass loop.
class Session::Loop {
 public:
  Loop(Session& session, const std::atomic<bool>* abandon, PassStatistics& statistics, RunReport& result)
      : session_(session),
        plan_(session.plan_),
        film_(session.film_),
        abandon_(abandon),
        statistics_(statistics),
        result_(result),
        target_(session.plan_.window.width(), session.plan_.window.height(), passPlanes(session.plan_)),
        startSeconds_(session.film_.seconds) {
    result_.rounds = result_.firstRound = film_.rounds();
    preparations_.resize(plan_.integrators.size());
    for (size_t i = 0; i < plan_.integrators.size(); ++i) {
      const Stopwatch preparing;
      // When abandoned meanwhile, it is worth nothing, but then the first pass is dropped as well.
      cancellable(abandon_,
                  [&] { preparations_[i] = plan_.integrators[i].integrator->prepare(session_.context_, plan_); });
      film_.estimates[i].seconds += preparing.seconds();
      if (preparations_[i])
        for (PlanLine& line : preparations_[i]->decisions()) result_.decisions.push_back(std::move(line));
    }
    recordDecisions();
  }

  // Whether the limits of the settings end the run; sets the reason then.
  bool limitReached() {
    const Settings& s = plan_.settings;
    if (s.spp > 0 && result_.rounds >= s.spp) return true;
    // A round that would end too late, as far as the last one tells, is not begun; the first one always is.
    const bool late = hasTimeLimit() && result_.rounds > result_.firstRound && timeLeft() <= lastRound_;
    if (late) result_.reason = StopReason::Time;
    return late;
  }

  // The map for the rounds to come, where one is due: it is made anew when a run goes on from there.
  void placeSamples() {
    if (!film_.placement || !mapIsDue(result_.rounds)) return;
    const Stopwatch clock;
    cancellable(abandon_, [&] { result_.placementGain = makePlacementMap(film_, result_.rounds, session_.placeBy_); });
    film_.estimates.front().seconds += clock.seconds();
  }

  // The passes that are missing to the next round, of every integrator. False when abandoned.
  bool round() {
    const double begin = seconds();
    placeSamples();
    for (size_t i = 0; i < plan_.integrators.size(); ++i) {
      const Stopwatch clock;
      const uint64_t wanted = (result_.rounds + 1) * static_cast<uint64_t>(plan_.integrators[i].passesPerRound);
      bool done = true;
      while (done && film_.estimates[i].sums.passes() < wanted) done = pass(i);
      film_.estimates[i].seconds += clock.seconds();
      if (!done) return false;
    }
    ++result_.rounds;
    lastRound_ = seconds() - begin;
    film_.seconds = startSeconds_ + seconds();
    if (plan_.settings.keep.history && std::has_single_bit(result_.rounds)) session_.keepCheckpoints();
    return true;
  }

  Progress progress() const {
    const Settings& s = plan_.settings;
    Progress p;
    p.round = result_.rounds;
    p.rounds = s.spp;
    p.seconds = seconds();
    p.rejected = film_.rejected();
    if (film_.placement) std::tie(p.fewestSamples, p.mostSamples) = film_.placement->range();
    const uint64_t done = p.round - result_.firstRound;
    if (s.spp > 0 && done > 0)
      p.secondsLeft = p.seconds / static_cast<double>(done) * static_cast<double>(s.spp - p.round);
    if (hasTimeLimit()) {
      const double left = std::max(0.0, timeLeft());
      p.secondsLeft = p.secondsLeft < 0 ? left : std::min(p.secondsLeft, left);
    }
    return p;
  }

  double seconds() const { return clock_.seconds(); }

 private:
  // What the preparations decided stands in the headers of images.
  void recordDecisions() {
    for (const PlanLine& line : result_.decisions) {
      const std::string name = "braid/" + line.subject;
      std::erase_if(film_.attributes, [&](const Attribute& a) { return a.name == name; });
      film_.attributes.push_back(textAttribute(name, fmt::format("{} {}", line.kept ? '+' : '-', line.reason)));
    }
  }
  bool hasTimeLimit() const { return session_.timeLeft_ || plan_.settings.seconds > 0; }
  double timeLeft() const { return session_.timeLeft_ ? session_.timeLeft_() : plan_.settings.seconds - seconds(); }

  bool pass(size_t i) {
    const Integrator& integrator = *plan_.integrators[i].integrator;
    EstimateState& e = film_.estimates[i];
    const uint64_t first = plan_.settings.firstRound * static_cast<uint64_t>(plan_.integrators[i].passesPerRound);
    const uint64_t pass = e.passes.empty() ? first : e.endPass();
    if (film_.placement) return placedPass(pass);
    target_.clear();
    if (!integrator.renderPass(
            {session_.context_, plan_, pass, abandon_, &statistics_, nullptr, preparations_[i].get()}, target_))
      return false;
    noteRejected(integrator, pass);
    commit(i, pass, true);
    e.addPass(pass);
    return true;
  }

  // A pass with as many samples of every tile as it is to get: the first ones, then the second ones, and so on. The
  // film holds whole passes: it is dropped when abandoned in the first ones, and finished later on.
  bool placedPass(uint64_t pass) {
    const Integrator& integrator = *plan_.integrators.front().integrator;
    SamplePlacement& placement = *film_.placement;
    const std::vector<int> samples = samplesOfPass(placement, pass);
    const int most = std::max(1, *std::max_element(samples.begin(), samples.end()));
    Plane<double>&count = placement.count[pass % 4], &hits = placement.hits[pass % 2];
    for (int k = 0; k < most; ++k) {
      TilePass tiles{std::vector<uint64_t>(placement.tiles(), TilePass::kNone),
                     std::vector<uint64_t>(placement.tiles(), 0)};
      std::vector<bool> rendered(placement.tiles());
      for (size_t t = 0; t < placement.tiles(); ++t)
        if (rendered[t] = samples[t] > k; rendered[t]) tiles.pass[t] = 4 * static_cast<uint64_t>(count[t]) + pass % 4;
      target_.clearFor(rendered);
      if (!integrator.renderPass({session_.context_, plan_, pass, k == 0 ? abandon_ : nullptr, &statistics_, nullptr,
                                  preparations_.front().get(), &tiles},
                                 target_))
        return false;
      noteRejected(integrator, pass);
      commit(0, pass, k == 0);
      for (size_t t = 0; t < placement.tiles(); ++t) {
        count[t] += samples[t] > k ? 1 : 0;
        hits[t] += static_cast<double>(tiles.hits[t]);
      }
    }
    film_.estimates.front().addPass(pass);
    return true;
  }

  void noteRejected(const Integrator& integrator, uint64_t pass) {
    const int64_t rejected = statistics_.rejectedPixel.load();
    if (rejected >= 0 && !result_.firstRejected)
      result_.firstRejected = {integrator.name(), pass, static_cast<int>(rejected % plan_.settings.width),
                               static_cast<int>(rejected / plan_.settings.width)};
  }

  // `counts`: not more samples of a pass that is among the sums already.
  void commit(size_t i, uint64_t pass, bool counts) {
    EstimateState& e = film_.estimates[i];
    e.sums.commit(pass, target_, counts);
    if (e.parts) e.parts->commit(pass, target_, counts);
    if (i == 0 && film_.features) film_.features->commit(pass, target_, counts);
    if (i == 0 && film_.coverage) film_.coverage->commit(target_);
  }

  Session& session_;
  const Plan& plan_;
  FilmState& film_;
  const std::atomic<bool>* abandon_;
  PassStatistics& statistics_;
  RunReport& result_;
  const Stopwatch clock_;
  double lastRound_ = 0;  // seconds
  PassTarget target_;
  std::vector<std::shared_ptr<const Preparation>> preparations_;
  const double startSeconds_;
};

Session::Session(const Scene& scene, Plan plan)
    : scene_(scene), plan_(std::move(plan)), context_(scene, plan_.settings.lightStrategy) {
  if (plan_.lightKinds) context_.lights.setKinds(*plan_.lightKinds);
  if (plan_.integrators.empty()) throw Error(ExitCode::Usage, "no integrator to run: name one with --integrator");
  film_ = emptyFilm(plan_, plan_.window.width(), plan_.window.height());
  film_.identity.isa = scene.accel().isa();
  film_.identity.sceneHash = scene.data().contentHash;
  film_.identity.options = pixelOptions(plan_);
  film_.seed = plan_.settings.seed;
  film_.window = plan_.window;
  film_.fullWidth = plan_.settings.width;
  film_.fullHeight = plan_.settings.height;
}

void Session::identify(const std::string& version, const std::string& build,
                       const std::vector<StateOption>& sceneOptions, std::vector<Attribute> attributes) {
  film_.identity.version = version;
  film_.identity.build = build;
  film_.identity.options.insert(film_.identity.options.end(), sceneOptions.begin(), sceneOptions.end());
  film_.attributes = std::move(attributes);
}

void Session::resume(FilmState state, const std::string& name) {
  const std::string differs = difference(state.identity, film_.identity, true);
  if (!differs.empty())
    throw Error(ExitCode::BadInput,
                fmt::format("{}: cannot be resumed: {}: render as it was begun, or begin anew", name, differs));
  // Equal options make equal accumulators, unless the file was tampered with.
  bool fits = holdSameSums(state, film_);
  for (size_t i = 0; fits && i < film_.estimates.size(); ++i)
    fits = state.estimates[i].passesPerRound == film_.estimates[i].passesPerRound;
  if (!fits) throw Error(ExitCode::BadInput, name + ": cannot be resumed: what it holds is not what its options say");
  state.attributes = std::move(film_.attributes);
  film_ = std::move(state);
}

RunReport Session::advance(const ProgressCallback& progress, const std::atomic<bool>* cancel,
                           const std::atomic<bool>* abandon, const std::atomic<bool>* reached) {
  PassStatistics statistics;
  RunReport result;
  withThreads(plan_.settings.threads, [&] {
    Loop loop(*this, abandon, statistics, result);
    while (!loop.limitReached()) {
      const bool abandoned = !loop.round();
      const bool goOn = !progress || progress(loop.progress());
      if (abandoned || !goOn || isSet(cancel)) {
        result.reason = StopReason::Cancelled;
        break;
      }
      if (isSet(reached)) {
        result.reason = StopReason::Error;
        break;
      }
    }
    result.seconds = loop.seconds();
  });
  result.paths = statistics.paths;
  result.rays = statistics.rays;
  result.shadowRays = statistics.shadowRays;
  result.rejected = film_.rejected();
  result.spp = film_.estimates.front().sums.passes();
  if (film_.placement) std::tie(result.fewestSamples, result.mostSamples) = film_.placement->range();
  return result;
}

RenderResult Session::run(const ProgressCallback& progress, const std::atomic<bool>* cancel,
                          const std::atomic<bool>* abandon, const std::atomic<bool>* reached) {
  RenderResult result;
  static_cast<RunReport&>(result) = advance(progress, cancel, abandon, reached);
  withThreads(plan_.settings.threads, [&] {
    result.estimates = snapshot();
    result.alpha = alpha();
  });
  result.image = result.estimates->estimates.front().mean;
  return result;
}

Estimates Session::estimates() const { return estimatesOf(film_, plan_.settings.keep.quarters); }

std::shared_ptr<const Estimates> Session::snapshot() const { return std::make_shared<const Estimates>(estimates()); }

std::optional<Plane<float>> Session::alpha() const {
  if (!film_.coverage) return std::nullopt;
  return film_.coverage->mean();
}

void Session::keepCheckpoints() {
  // The passes before a later share are not its own: where the stop lies is known when shares are added.
  const std::vector<uint64_t> stops =
      plan_.settings.firstRound > 0 ? std::vector<uint64_t>{} : plan_.settings.keep.stops;
  for (EstimateState& e : film_.estimates) e.keepCheckpoint(stops, film_.placement ? &*film_.placement : nullptr);
}

}  // namespace braid
