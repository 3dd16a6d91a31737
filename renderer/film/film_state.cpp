// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/film_state.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/placed_sums.h"
#include "renderer/film/planes.h"

namespace braid {

namespace {

// `A`: a FeatureAccumulator or PlacedFeatures.
template <class A>
Features collectFeatures(const A& a) {
  Features features;
  int component = 0;
  for (size_t f = 0; f < kFeaturePlanes.size(); ++f)
    for (size_t c = 0; c < kFeaturePlanes[f].components.size(); ++c, ++component) {
      featurePlane(features, f, 0, c) = a.mean(component);
      for (int h = 0; h < 2; ++h) featurePlane(features, f, static_cast<size_t>(h) + 1, c) = a.halfMean(component, h);
      featurePlane(features, f, 3, c) = a.variance(component);
    }
  return features;
}

EstimateHead headOf(const EstimateState& state) {
  return {state.name, state.unbiased, state.correlation, state.sums.passes(), state.seconds, state.sums.rejected()};
}

// Of a film whose tiles have different numbers of samples.
Estimate placedEstimateOf(const EstimateState& state, const SamplePlacement& placement, bool quarters) {
  const PlacedSums sums(state.sums, placement);
  Estimate estimate;
  static_cast<EstimateHead&>(estimate) = headOf(state);
  estimate.mean = sums.mean();
  for (int h = 0; h < 2; ++h) estimate.half[h] = sums.halfMean(h);
  for (int k = 0; quarters && k < 4; ++k) estimate.quarter.push_back(sums.bucketMean(k));
  estimate.variance = sums.variance(state.lowDiscrepancy);
  estimate.samples = placement.samples();
  if (state.parts) {
    const PlacedSums direct(state.parts->direct(), placement);
    estimate.direct = {direct.mean(), {direct.halfMean(0), direct.halfMean(1)}, direct.variance(state.lowDiscrepancy)};
    const Accumulator indirect = state.parts->indirect(state.sums);
    estimate.indirectVariance = PlacedSums(indirect, placement).variance(state.lowDiscrepancy);
  }
  return estimate;
}

Estimate estimateOf(const EstimateState& state, bool quarters) {
  const Accumulator& a = state.sums;
  Estimate estimate;
  static_cast<EstimateHead&>(estimate) = headOf(state);
  estimate.mean = a.mean();
  for (int h = 0; h < 2; ++h) estimate.half[h] = a.halfMean(h);
  if (quarters && a.bucketCount() == 4)
    for (int k = 0; k < 4; ++k) estimate.quarter.push_back(a.bucketMean(k));
  estimate.variance = a.variance(state.lowDiscrepancy);
  if (a.keepsBias()) {
    estimate.bias = a.biasMean();
    for (int h = 0; h < 2; ++h) estimate.biasHalf[h] = a.biasHalfMean(h);
    estimate.biasVariance = a.biasVariance();
  }
  if (state.parts) {
    estimate.direct = state.parts->directPart(state.lowDiscrepancy);
    estimate.indirectVariance = state.parts->indirectVariance(a, state.lowDiscrepancy);
  }
  return estimate;
}

void sayDifference(std::string& text, const std::string& what, const std::string& there, const std::string& here) {
  if (there == here) return;
  const auto shown = [](const std::string& value) { return value.empty() ? std::string("not given") : value; };
  text += fmt::format("{}{} was {} and is {}", text.empty() ? "" : "; ", what, shown(there), shown(here));
}

std::string valueOf(const std::vector<StateOption>& options, const std::string& name) {
  for (const StateOption& o : options)
    if (o.name == name) return o.value;
  return {};
}

constexpr char kStops[] = "the stop of denoising";
constexpr char kRevision[] = "the rendering revision";

// Sorts, and joins intervals that touch.
void normalise(std::vector<PassInterval>& list) {
  std::sort(list.begin(), list.end(), [](const PassInterval& a, const PassInterval& b) { return a.begin < b.begin; });
  std::vector<PassInterval> joined;
  for (const PassInterval& i : list)
    if (!joined.empty() && joined.back().end == i.begin)
      joined.back().end = i.end;
    else
      joined.push_back(i);
  list = std::move(joined);
}

// Reads only.
RawSums sumsOf(const EstimateState& e) { return const_cast<EstimateState&>(e).rawSums(); }
RawSums sumsOf(const FilmState& s) { return const_cast<FilmState&>(s).sharedSums(); }

bool sameNames(const RawSums& a, const RawSums& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const RawSum& x, const RawSum& y) {
    return x.name == y.name && x.plane->width == y.plane->width && x.plane->height == y.plane->height;
  });
}

}  // namespace

RawSums EstimateState::rawSums() {
  RawSums list;
  sums.listSums(name + ".sum", name + ".squares", list);
  sums.listBias(name + ".bias", list);
  if (parts) parts->listSums(name + '.', list);
  return list;
}

RawSums FilmState::sharedSums() {
  RawSums list;
  if (features) features->listSums("features.", list);
  if (coverage) coverage->listSums("coverage", list);
  if (placement) placement->listSums(list);
  return list;
}

void EstimateState::addPass(uint64_t pass) {
  BRAID_ASSERT(passes.empty() || pass >= passes.back().end);
  if (!passes.empty() && passes.back().end == pass)
    ++passes.back().end;
  else
    passes.push_back({pass, pass + 1});
}

void EstimateState::keepCheckpoint(const std::vector<uint64_t>& stops, const SamplePlacement* placement) {
  const uint64_t before = history.empty() ? 0 : history.back().passes;
  std::optional<PlacedSums> placed;
  if (placement && !placement->even()) placed.emplace(sums, *placement);
  Checkpoint c{sums.passes(), seconds, placed ? placed->variance(lowDiscrepancy) : sums.variance(lowDiscrepancy)};
  const bool image = std::any_of(stops.begin(), stops.end(), [&](uint64_t n) { return n > before && n <= c.passes; });
  if (image && unbiased && correlation == Correlation::Independent) {
    c.mean = placed ? placed->mean() : sums.mean();
    for (int h = 0; h < 2; ++h) c.half[h] = placed ? placed->halfMean(h) : sums.halfMean(h);
  }
  history.push_back(std::move(c));
}

std::vector<StateOption> stopOptions(const std::vector<uint64_t>& stops) {
  if (stops.empty()) return {};
  return {{kStops, fmt::format("{}", fmt::join(stops, ","))}};
}

std::vector<uint64_t> stopsOf(const StateIdentity& identity) {
  std::vector<uint64_t> stops;
  const std::string text = valueOf(identity.options, kStops);
  const char *at = text.data(), *end = at + text.size();
  for (uint64_t n = 0; at < end; ++at) {
    const auto [next, error] = std::from_chars(at, end, n);
    if (error != std::errc()) break;
    stops.push_back(n);
    at = next;
  }
  return stops;
}

uint64_t FilmState::rounds() const {
  if (estimates.empty()) return 0;
  uint64_t rounds = kMaxPass;
  for (const EstimateState& e : estimates)
    rounds = std::min(rounds, e.sums.passes() / static_cast<uint64_t>(e.passesPerRound));
  return rounds;
}

uint64_t FilmState::rejected() const {
  uint64_t count = 0;
  for (const EstimateState& e : estimates) count += e.sums.rejected();
  return count;
}

namespace {

Estimates estimatesHead(const FilmState& state) {
  Estimates e;
  static_cast<EstimatesHead&>(e) = {state.window.width(), state.window.height(), state.window,
                                    state.fullWidth,      state.fullHeight,      state.seed};
  return e;
}

}  // namespace

Estimates estimatesOf(const FilmState& state, bool quarters) {
  Estimates e = estimatesHead(state);
  const bool placed = state.placement && !state.placement->even();
  for (const EstimateState& s : state.estimates) {
    e.estimates.push_back(placed ? placedEstimateOf(s, *state.placement, quarters) : estimateOf(s, quarters));
    if (!s.history.empty()) e.history[s.name] = s.history;
  }
  if (state.features)
    e.features =
        placed ? collectFeatures(PlacedFeatures(*state.features, *state.placement)) : collectFeatures(*state.features);
  return e;
}

Estimates estimatesOfHalf(const FilmState& state, int half, bool features) {
  BRAID_ASSERT(state.placement && state.estimates.size() == 1);
  const EstimateState& s = state.estimates.front();
  const PlacedSums sums(s.sums, *state.placement);
  Estimates e = estimatesHead(state);
  Estimate& one = e.estimates.emplace_back();
  static_cast<EstimateHead&>(one) = headOf(s);
  one.passes = s.sums.passesInBucket(half) + s.sums.passesInBucket(half + 2);
  one.mean = sums.halfMean(half);
  for (int k = 0; k < 2; ++k) one.half[k] = sums.bucketMean(half + 2 * k);
  one.variance = sums.halfVariance(half, s.lowDiscrepancy);
  if (!state.features || !features) return e;
  // Features have no quarters: the variance is that of the mean of both halves, twice.
  const PlacedFeatures placed(*state.features, *state.placement);
  e.features = collectFeatures(placed);
  forEachFeature(*e.features, [&](auto& planes) {
    planes.mean = planes.half[half];
    planes.half[0] = planes.half[1] = {};
  });
  return e;
}

std::string difference(const StateIdentity& there, const StateIdentity& here, bool sameBits) {
  std::string text;
  sayDifference(text, "the version of braid", there.version, here.version);
  sayDifference(text, kRevision, valueOf(there.options, kRevision), valueOf(here.options, kRevision));
  if (!text.empty()) return text;  // another braid has other options
  if (sameBits) {
    sayDifference(text, "the build", there.build, here.build);
    sayDifference(text, "--isa", there.isa, here.isa);
  }
  sayDifference(text, "the scene's content", hexString(there.sceneHash), hexString(here.sceneHash));
  for (const StateOption& o : there.options) sayDifference(text, o.name, o.value, valueOf(here.options, o.name));
  for (const StateOption& o : here.options) {
    const bool known = std::any_of(there.options.begin(), there.options.end(),
                                   [&](const StateOption& other) { return other.name == o.name; });
    if (!known) sayDifference(text, o.name, "", o.value);
  }
  return text;
}

std::string overlap(const FilmState& a, const FilmState& b) {
  for (const EstimateState& ea : a.estimates)
    for (const EstimateState& eb : b.estimates) {
      if (ea.name != eb.name) continue;
      for (const PassInterval& i : ea.passes)
        for (const PassInterval& j : eb.passes)
          if (i.begin < j.end && j.begin < i.end)
            return fmt::format("both hold the passes {}:{} of {}", std::max(i.begin, j.begin), std::min(i.end, j.end),
                               ea.name);
    }
  return {};
}

bool holdSameSums(const FilmState& a, const FilmState& b) {
  return a.window == b.window && sameNames(sumsOf(a), sumsOf(b)) &&
         std::equal(a.estimates.begin(), a.estimates.end(), b.estimates.begin(), b.estimates.end(),
                    [](const EstimateState& x, const EstimateState& y) { return sameNames(sumsOf(x), sumsOf(y)); });
}

void addShare(FilmState& state, const FilmState& next) {
  BRAID_ASSERT(holdSameSums(state, next));
  for (size_t i = 0; i < state.estimates.size(); ++i) {
    EstimateState& e = state.estimates[i];
    const EstimateState& n = next.estimates[i];
    if (!e.history.empty() && e.history.back().passes < e.sums.passes())
      e.keepCheckpoint(stopsOf(state.identity), state.placement ? &*state.placement : nullptr);
    addSums(e.rawSums(), sumsOf(n));
    e.sums.addCounts(n.sums);
    if (e.parts) e.parts->addCounts(*n.parts);
    e.seconds += n.seconds;
    e.passes.insert(e.passes.end(), n.passes.begin(), n.passes.end());
    normalise(e.passes);
  }
  addSums(state.sharedSums(), sumsOf(next));
  if (state.features) state.features->addCounts(*next.features);
  if (state.coverage) state.coverage->addCount(*next.coverage);
  state.seconds += next.seconds;
}

}  // namespace braid
