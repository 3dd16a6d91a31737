// SPDX-License-Identifier: Apache-2.0
// Which integrators a plan has: those that are named, or with `auto` those that traits, the reach of light and, where
// these leave it open, a pilot speak for.
#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/session/film_of_plan.h"
#include "renderer/session/integrator.h"
#include "renderer/session/mixture/mixture.h"
#include "renderer/session/mixture/pilot_blocks.h"

namespace braid {

namespace {

// From this share of the light in view on, what cannot be found is told.
constexpr double kMissedLight = 0.01;
// From this share on, a pilot does not consider it.
constexpr double kMissedByChoice = 0.001;

// Frames with fewer pixels, and renders of fewer samples, cost less than a pilot is worth.
constexpr uint64_t kFewestPixels = 16384, kFewestSamples = 16;
// The pilot renders a pixel for every eight of the frame, up to 128 x 72 of them.
constexpr uint64_t kPixelsOfPilot = 8, kMostPilotPixels = 9216;
constexpr int kPilotPasses = 8;
constexpr uint64_t kPilotSeed = 0x70696c6f74;
// Samples that the choice is made for: it must not depend on how many there will be, or states could not be resumed.
constexpr double kSamplesAhead = 64;
// Of a shadow ray, of a photon that a gather finds, and of a gather, in rays.
constexpr double kShadowCost = 0.4, kPhotonCost = 0.05, kGatherCost = 0.2;
// Of a ray whose vertices are connected to others, in rays.
constexpr double kConnectingCost = 1.25;
// Squared relative error where caustics that are found by rare chance alone are not met, over their squared share.
constexpr double kUnmetCaustics = 2;

// Whether some of the light of points and directions may be scattered by mirrors or smooth refraction first.
bool mayMissLight(const SceneTraits& t) {
  return t.has(kTraitPointLights | kTraitDirectionalLights) &&
         t.hasLobe(kLobeSpecular | kLobeTransmission | kLobeClearcoat);
}

// Alpha of shadows follows from the light that camera paths find: what light paths bring has none.
bool wantsShadowAlpha(const Scene& scene, const Settings& s) { return scene.data().ground && s.transparent; }
bool hasShadowAlpha(const Integrator& i) {
  const std::string_view name = i.name();
  return name == "pt" || name == "crn";
}

// Whether `auto` runs it.
Applies appliesHere(const Integrator& i, const Scene& scene, const Settings& settings, const LightReach& reach) {
  if (!wantsShadowAlpha(scene, settings)) return i.applies(scene.traits(), reach);
  if (!hasShadowAlpha(i)) return {false, "has no alpha of shadows (--ground --transparent)"};
  if (i.name() == std::string_view("pt")) return {true, "its paths know the alpha of shadows (--ground --transparent)"};
  return i.applies(scene.traits(), reach);
}

void planUnreachable(const LightReach& reach, bool shadowAlpha, Plan& plan) {
  double missed = 1;
  std::string names;
  for (const PlannedIntegrator& p : plan.integrators) {
    missed = std::min(missed, p.integrator->misses(reach));
    names += fmt::format("{}{}", names.empty() ? "" : ", ", p.integrator->name());
  }
  if (plan.integrators.empty() || missed < kMissedLight) return;
  plan.unreachable = fmt::format(
      "{:.3g} % of the light in view comes from lights without size over mirrors or through solids that refract, where "
      "{} cannot find it: --integrator auto can{}",
      100 * missed, names, shadowAlpha ? ", without --transparent" : "");
  plan.lines.push_back({false, "light out of reach", plan.unreachable});
}

// A few passes of every candidate at a reduced size, whose images are dropped. A pure function of scene, camera, size
// of the frame and seed.
class Pilot {
 public:
  Pilot(const TransportContext& context, const CameraData& camera, const Plan& plan) : context_(context), plan_(plan) {
    Settings& s = plan_.settings;
    const double pixels = static_cast<double>(s.width) * s.height;
    const double kept = std::min(pixels / kPixelsOfPilot, static_cast<double>(kMostPilotPixels));
    scale_ = std::sqrt(kept / pixels);
    const auto scaled = [&](int side) { return std::max(1, static_cast<int>(std::lround(scale_ * side))); };
    const uint64_t frame = static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height);
    s.width = scaled(s.width);
    s.height = scaled(s.height);
    if (s.photons > 0) s.photons = std::max<uint64_t>(1, s.photons * pixelCount() / frame);
    s.crop.reset();
    s.seed ^= kPilotSeed;
    s.guiding = Guiding::Off;
    s.transparent = false;
    s.keep = KeptBuffers{.features = false, .quarters = true};
    plan_.kept = s.keep;
    plan_.camera = Camera(camera, s.width, s.height);
    plan_.window = {0, 0, s.width, s.height};
    plan_.integrators.clear();
    plan_.lines.clear();
  }

  void add(const Integrator& integrator) {
    runs_.push_back(Run{&integrator, Accumulator(width(), height(), plan_.buckets(), integrator.estimatesBias()), 0});
    Run& run = runs_.back();
    plan_.integrators = {{&integrator, 1}};
    PassTarget target(width(), height(), passPlanes(plan_));
    PassStatistics counts;
    const std::shared_ptr<const Preparation> preparation = integrator.prepare(context_, plan_);
    for (uint64_t pass = 0; pass < kPilotPasses; ++pass) {
      target.clear();
      integrator.renderPass({context_, plan_, pass, nullptr, &counts, nullptr, preparation.get()}, target);
      run.sums.commit(pass, target);
    }
    const double gathers = integrator.estimatesBias() ? static_cast<double>(counts.paths) : 0;
    const double rays = static_cast<double>(counts.rays) + kShadowCost * static_cast<double>(counts.shadowRays);
    run.cost = ((integrator.splats() ? kConnectingCost : 1) * rays + kPhotonCost * static_cast<double>(counts.photons) +
                kGatherCost * gathers) /
               (kPilotPasses * static_cast<double>(pixelCount()));
  }

  // Of all that were added, in their order. Edges of light, where bias is, take a smaller part of a larger frame.
  std::vector<PilotMeasure> measures() const {
    std::vector<const Accumulator*> sums;
    for (const Run& run : runs_) sums.push_back(&run.sums);
    const std::vector<float> scales = blockScales(sums);
    std::vector<PilotMeasure> list;
    for (const Run& run : runs_)
      list.push_back({run.integrator->unbiased(), run.cost, kPilotPasses, 0,
                      blocksOf(run.sums, run.integrator->lowDiscrepancy(plan_.settings), scales, scale_)});
    return list;
  }

  std::string text() const { return fmt::format("{} passes of {}x{} pixels", kPilotPasses, width(), height()); }

 private:
  struct Run {
    const Integrator* integrator;
    Accumulator sums;
    double cost;
  };

  int width() const { return plan_.settings.width; }
  int height() const { return plan_.settings.height; }
  uint64_t pixelCount() const { return static_cast<uint64_t>(width()) * static_cast<uint64_t>(height()); }

  const TransportContext& context_;
  Plan plan_;
  double scale_ = 1;
  std::vector<Run> runs_;
};

// An integrator that is named or that `auto` considers, and whether it is kept.
struct Candidate {
  const Integrator* integrator;
  Applies applies;
};

std::vector<Candidate> candidatesOf(const Scene& scene, const Settings& settings,
                                    const std::vector<const Integrator*>& available, const LightReach& reach) {
  const bool shadowAlpha = wantsShadowAlpha(scene, settings);
  std::vector<Candidate> candidates;
  for (const std::string& name : settings.integrators) {
    bool found = false;
    for (const Integrator* i : available) {
      if (name != "auto" && name != i->name()) continue;
      found = true;
      if (name != "auto" && shadowAlpha && !hasShadowAlpha(*i))
        throw Error(ExitCode::Usage,
                    "--ground --transparent: " + name + " has no alpha of shadows: use --integrator auto or pt");
      const auto known =
          std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& c) { return c.integrator == i; });
      // An integrator asked for by name runs even where the scene does not need it; how light reaches what is in view
      // is not measured for it.
      const Applies applies =
          name == "auto" ? appliesHere(*i, scene, settings, reach) : Applies{true, "as --integrator says"};
      if (known == candidates.end())
        candidates.push_back({i, applies});
      else if (name != "auto")
        known->applies = applies;
    }
    if (!found) {
      std::vector<std::string> known;
      for (const Integrator* i : available) known.push_back(i->name());
      throw Error(ExitCode::Usage,
                  fmt::format("unknown integrator '{}': known are auto, {}", name, fmt::join(known, ", ")));
    }
  }
  return candidates;
}

// Why no pilot is rendered; empty: one is.
std::string noPilotBecause(const Settings& s) {
  if (static_cast<uint64_t>(s.width) * static_cast<uint64_t>(s.height) < kFewestPixels)
    return fmt::format("the frame has fewer than {} pixels", kFewestPixels);
  if (s.spp > 0 && s.spp < kFewestSamples && !s.goesOn) return fmt::format("fewer than {} samples", kFewestSamples);
  return {};
}

// The mixtures of what is open: every unbiased integrator that finds the light in view, alone and beside every photon
// map. The one that traits and reach name comes first.
std::vector<Mixture> mixturesOf(const std::vector<Candidate*>& open, const LightReach& reach) {
  std::vector<Mixture> mixtures;
  const auto add = [&](size_t unbiased, size_t photons) {
    const bool present = open[unbiased]->applies.yes && photons != Mixture::kNone && open[photons]->applies.yes;
    mixtures.insert(present ? mixtures.begin() : mixtures.end(), {unbiased, photons});
  };
  for (size_t u = 0; u < open.size(); ++u) {
    const Integrator& i = *open[u]->integrator;
    const bool blind = i.misses(reach) >= kMissedByChoice;
    if (!i.unbiased() || (blind && !open[u]->applies.yes)) continue;
    if (!blind) add(u, Mixture::kNone);
    for (size_t p = 0; p < open.size(); ++p)
      if (open[p]->integrator->estimatesBias()) add(u, p);
  }
  return mixtures;
}

std::string nameOf(const Mixture& m, const std::vector<Candidate*>& open) {
  std::string name = open[m.unbiased]->integrator->name();
  return m.photons == Mixture::kNone ? name : name + "," + open[m.photons]->integrator->name();
}

// Keeps those of the best mixture, and says what the others would have cost.
void follow(const MixtureChoice& choice, const std::vector<Mixture>& mixtures, const std::vector<Candidate*>& open) {
  const Mixture& best = mixtures[choice.best];
  for (size_t i = 0; i < open.size(); ++i) {
    double least = -1;
    for (size_t m = 0; m < mixtures.size(); ++m)
      if (mixtures[m].unbiased == i || mixtures[m].photons == i)
        least = least < 0 ? choice.error[m] : std::min(least, choice.error[m]);
    Applies& applies = open[i]->applies;
    const bool kept = best.unbiased == i || best.photons == i;
    if (kept == applies.yes || least < 0) continue;
    const double ratio = choice.error[choice.best] > 0 ? least / choice.error[choice.best] : 1;
    applies = {kept, kept ? "a pilot promises less error by it at equal cost"
                          : fmt::format("a pilot promises {:.2f} times the error with it, at equal cost", ratio)};
  }
}

// What a pilot makes of the candidates that are open, in a line of the plan.
PlanLine choose(const TransportContext& context, const CameraData& camera, const Plan& plan, const LightReach& reach,
                const std::vector<Candidate*>& open) {
  const std::vector<Mixture> mixtures = mixturesOf(open, reach);
  Pilot pilot(context, camera, plan);
  withThreads(plan.settings.threads, [&] {
    for (const Candidate* c : open) pilot.add(*c->integrator);
  });
  std::vector<PilotMeasure> measures = pilot.measures();
  for (size_t i = 0; i < open.size(); ++i)
    measures[i].hidden =
        kUnmetCaustics * sqr(open[i]->integrator->splats() ? reach.causticOverMirrors : reach.causticBySmooth);
  const MixtureChoice choice = chooseMixture(mixtures, 0, measures, kSamplesAhead);
  std::vector<std::string> errors, costs;
  for (size_t m = 0; m < mixtures.size(); ++m)
    errors.push_back(fmt::format("{} {:.3g}{}", nameOf(mixtures[m], open),
                                 choice.error[0] > 0 ? choice.error[m] / choice.error[0] : 1,
                                 m == 0 ? "" : fmt::format(" ± {:.0f} %", 100 * choice.uncertainty[m])));
  for (size_t i = 0; i < open.size(); ++i)
    costs.push_back(fmt::format("{} {:.3g}", open[i]->integrator->name(), measures[i].cost));
  follow(choice, mixtures, open);
  return {true, "pilot",
          fmt::format("{}: {}, by the errors at equal cost ({}) of {}; rays a sample: {}",
                      nameOf(mixtures[choice.best], open),
                      choice.best == 0 ? "no other mixture is better beyond doubt" : "the best mixture",
                      fmt::join(errors, ", "), pilot.text(), fmt::join(costs, ", "))};
}

// Headline and shares.
void planRounds(const Settings& settings, Plan& plan) {
  if (plan.integrators.size() < 2) return;
  // The first one is the headline when nothing combines them. Photons are kept where unbiased images are led by
  // fireflies.
  const bool chosen = settings.integrators == std::vector<std::string>{"auto"};
  if (chosen)
    std::stable_partition(plan.integrators.begin(), plan.integrators.end(),
                          [](const PlannedIntegrator& p) { return !p.integrator->unbiased(); });
  plan.lines.push_back(
      {true, "headline", fmt::format("{}, unless a combiner makes it", plan.integrators[0].integrator->name())});
  std::string shares;
  for (const PlannedIntegrator& p : plan.integrators)
    shares += fmt::format("{}{} {}", shares.empty() ? "" : ", ", p.integrator->name(), p.passesPerRound);
  plan.lines.push_back({true, "passes of a round", shares});
}

}  // namespace

void planIntegrators(const Scene& scene, const CameraData& camera, const std::vector<const Integrator*>& available,
                     Plan& plan) {
  const Settings& settings = plan.settings;
  std::optional<TransportContext> context;
  LightReach reach;
  const bool automatic =
      std::find(settings.integrators.begin(), settings.integrators.end(), "auto") != settings.integrators.end();
  if (automatic || mayMissLight(scene.traits())) {
    context.emplace(scene, settings.lightStrategy);
    if (plan.lightKinds) context->lights.setKinds(*plan.lightKinds);
    reach = measureLightReach(*context, plan.camera, settings.width, settings.height);
  }
  const bool shadowAlpha = wantsShadowAlpha(scene, settings);
  std::vector<Candidate> candidates = candidatesOf(scene, settings, available, reach);
  std::vector<Candidate*> open;
  for (Candidate& c : candidates)
    if (c.applies.open) open.push_back(&c);
  std::optional<PlanLine> pilot;
  if (open.size() > 1 && !settings.full) {
    const std::string none = noPilotBecause(settings);
    pilot = none.empty() ? choose(*context, camera, plan, reach, open) : PlanLine{false, "pilot", none};
  }
  for (const Candidate& c : candidates) {
    const bool kept = c.applies.yes || (settings.full && (!shadowAlpha || hasShadowAlpha(*c.integrator)));
    plan.lines.push_back({kept, c.integrator->name(), c.applies.reason});
    if (kept) plan.integrators.push_back({c.integrator, 1});
  }
  if (pilot) plan.lines.push_back(*pilot);
  planUnreachable(reach, shadowAlpha, plan);
  planRounds(settings, plan);
}

}  // namespace braid
