// SPDX-License-Identifier: Apache-2.0
// States: a render that is interrupted and resumed, or split into shares and added up, is the render that was neither.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/state_file.h"
#include "renderer/session/rendering_revision.h"
#include "tests/film/state_renders.h"
#include "tests/support/command_line.h"
#include "tests/support/contains.h"
#include "tests/support/render_fixture.h"

namespace braid::test_state {

using namespace test::state_renders;
using test::contains;
using test::Folder;
using test::integrators;

namespace {

// The largest difference relative to the value.
double farthest(const Plane<double>& a, const Plane<double>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i)
    if (a[i] != b[i]) most = std::max(most, std::fabs(a[i] - b[i]) / std::max(std::fabs(a[i]), std::fabs(b[i])));
  return most;
}

double farthest(const Rgb<double>& a, const Rgb<double>& b) {
  return std::max({farthest(a[0], b[0]), farthest(a[1], b[1]), farthest(a[2], b[2])});
}

double farthest(const std::vector<Plane<double>>& a, const std::vector<Plane<double>>& b) {
  REQUIRE(a.size() == b.size());
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, farthest(a[i], b[i]));
  return most;
}

}  // namespace

TEST_CASE("A render resumed from a file is the render that was not interrupted, for every integrator and for all") {
  const Folder folder;
  const std::string file = folder.path / "r.state";
  std::vector<std::string> names{"all"};
  for (const Integrator* i : integrators()) names.push_back(i->name());
  for (const std::string& name : names) {
    INFO(name);
    const FilmState whole = stateOf(everythingKept(name, 9));
    CHECK(whole.rounds() == 9);
    CHECK(whole.estimates[0].history.size() == 4);
    Settings settings = everythingKept(name, 3);
    writeStateFile(file, stateOf(settings));
    for (const uint64_t spp : {6, 9}) {  // two interruptions
      settings.spp = spp;
      settings.threads = spp == 6 ? 1 : 2;
      Session session = sessionFor(settings);
      session.resume(readStateFile(file), file);
      const RenderResult result = session.run();
      CHECK(result.rounds == spp);
      CHECK(result.firstRound == spp - 3);
      writeStateFile(file, session.state());
    }
    checkSame(whole, readStateFile(file));
    // And what everyone sees of it.
    const Estimates a = estimatesOf(whole, true), b = estimatesOf(readStateFile(file), true);
    for (size_t i = 0; i < a.estimates.size(); ++i) {
      CHECK(sameBits(a.estimates[i].mean, b.estimates[i].mean));
      CHECK(sameBits(a.estimates[i].variance, b.estimates[i].variance));
      CHECK(sameBits(a.estimates[i].direct.variance, b.estimates[i].direct.variance));
      CHECK(sameBits(a.estimates[i].indirectVariance, b.estimates[i].indirectVariance));
      CHECK(a.estimates[i].direct.mean.empty() == (a.estimates[i].name != "pt"));
      CHECK(a.estimates[i].quarter.size() == 4);
    }
  }
}

TEST_CASE("A run that stops within a round makes up for the missing passes when resumed") {
  const Settings settings = everythingKept("all", 4);
  const FilmState whole = stateOf(settings);
  Session first = sessionFor(settings);
  std::atomic<bool> abandon{false};
  first.run(
      [&](const Progress& p) {
        abandon = p.round == 2;
        return true;
      },
      nullptr, &abandon);
  CHECK(first.state().rounds() == 2);
  // As if the first integrator alone had finished its pass.
  FilmState partial = first.state();
  Settings ahead = settings;
  ahead.spp = 3;
  FilmState other = stateOf(ahead);
  std::swap(partial.estimates[0], other.estimates[0]);
  partial.features = other.features;
  partial.coverage = other.coverage;
  Session second = sessionFor(settings);
  second.resume(partial, "partial");
  CHECK(second.run().firstRound == 2);
  checkSame(whole, second.state(), false);
}

TEST_CASE("Shares of the passes add up to the whole, for every integrator") {
  for (const Integrator* i : integrators()) {
    INFO(i->name());
    const FilmState whole = stateOf(everythingKept(i->name(), 11));
    std::vector<FilmState> shares;
    for (const auto& [begin, end] : {std::pair(0, 4), {4, 5}, {5, 11}}) {
      Settings settings = everythingKept(i->name(), static_cast<uint64_t>(end - begin));
      settings.firstRound = static_cast<uint64_t>(begin);
      shares.push_back(stateOf(settings));
      CHECK(shares.back().estimates[0].firstPass() == static_cast<uint64_t>(begin));
      CHECK(difference(shares[0].identity, shares.back().identity, true).empty());
    }
    CHECK(overlap(shares[0], shares[1]).empty());
    CHECK(overlap(shares[1], whole) == std::string("both hold the passes 4:5 of ") + i->name());
    FilmState merged = shares[0];
    addShare(merged, shares[1]);
    addShare(merged, shares[2]);
    const EstimateState &a = whole.estimates[0], &b = merged.estimates[0];
    CHECK(b.passes == a.passes);
    for (size_t k = 0; k < 4; ++k) {
      CHECK(sameBits(a.sums.sums()[k], b.sums.sums()[k]));
      CHECK(a.sums.passesInBucket(static_cast<int>(k)) == b.sums.passesInBucket(static_cast<int>(k)));
    }
    CHECK(farthest(a.sums.sumOfSquares(), b.sums.sumOfSquares()) < 1e-14);
    REQUIRE(a.parts.has_value() == b.parts.has_value());
    if (a.parts) {
      for (size_t k = 0; k < 4; ++k) CHECK(sameBits(a.parts->direct().sums()[k], b.parts->direct().sums()[k]));
      CHECK(farthest(a.parts->direct().sumOfSquares(), b.parts->direct().sumOfSquares()) < 1e-14);
      CHECK(farthest(a.parts->indirectSumOfSquares(), b.parts->indirectSumOfSquares()) < 1e-14);
    }
    if (a.sums.keepsBias()) {
      for (int h = 0; h < 2; ++h) CHECK(farthest(a.sums.biasSum(h), b.sums.biasSum(h)) < 1e-13);
      CHECK(farthest(a.sums.biasSumOfSquares(), b.sums.biasSumOfSquares()) < 1e-14);
    }
    for (int h = 0; h < 2; ++h) CHECK(farthest(whole.features->sums(h), merged.features->sums(h)) < 1e-13);
    CHECK(farthest(whole.features->sumsOfSquares(), merged.features->sumsOfSquares()) < 1e-14);
    CHECK(sameBits(whole.coverage->sums(), merged.coverage->sums()));
    CHECK(sameBits(estimatesOf(whole, false).estimates[0].mean, estimatesOf(merged, false).estimates[0].mean));
    // 1, 2 and 4 passes of the first share, then the end of the second.
    REQUIRE(b.history.size() == 4);
    CHECK(b.history[2].passes == 4);
    CHECK(b.history[3].passes == 5);
    CHECK(sameBits(b.history[1].variance, a.history[1].variance));
  }
}

TEST_CASE("Intervals of passes keep gaps, and a resumed state goes on behind the last one") {
  Settings settings = everythingKept("pt", 2);
  FilmState state = stateOf(settings);
  settings.firstRound = 5;
  addShare(state, stateOf(settings));
  REQUIRE(state.estimates[0].passes.size() == 2);
  CHECK(state.estimates[0].passes[1] == PassInterval{5, 7});
  Session session = sessionFor(everythingKept("pt", 6));
  session.resume(state, "gap");
  session.run();
  CHECK(session.state().estimates[0].passes[1] == PassInterval{5, 9});
  CHECK(session.state().estimates[0].sums.passes() == 6);
}

TEST_CASE("States of other renders are refused with a sentence that names what differs") {
  const FilmState state = stateOf(everythingKept("pt", 2));
  const auto refused = [&](const Settings& settings, const std::string& version = "") {
    Session session = sessionFor(settings);
    session.identify(version, "", {}, {});
    try {
      session.resume(state, "old.state");
    } catch (const Error& e) {
      CHECK(e.code() == ExitCode::BadInput);
      return std::string(e.what());
    }
    return std::string();
  };
  Settings s = everythingKept("pt", 99);
  s.threads = 1;
  s.seconds = 5;
  CHECK(refused(s).empty());
  CHECK(contains(refused(s, "9.9"), "the version of braid was not given and is 9.9"));
  s.maxDepth = 5;
  s.seed = 3;
  CHECK(contains(refused(s), "old.state: cannot be resumed: --seed was 0 and is 3; --max-depth was 32 and is 5"));
  StateIdentity older = state.identity;
  for (StateOption& o : older.options)
    if (o.name == "the rendering revision") o.value = "0";
  older.options.push_back({"--option-of-then", "on"});  // options of another braid are not compared
  CHECK(difference(older, state.identity, false) ==
        fmt::format("the rendering revision was 0 and is {}", kRenderingRevision));
  const auto changed = [&](const auto& change) {
    Settings other = everythingKept("pt", 2);
    change(other);
    return refused(other);
  };
  CHECK(contains(changed([](Settings& o) { o.width = 15; }), "--size was 14x11 and is 15x11"));
  CHECK(contains(changed([](Settings& o) { o.crop = PixelWindow{0, 0, 3, 3}; }), "--crop"));
  CHECK(contains(changed([](Settings& o) { o.integrators = {"pt", "crn"}; }), "--integrator was pt and is pt,crn"));
  CHECK(contains(changed([](Settings& o) { o.sampler = SamplerKind::Independent; }), "--sampler"));
  CHECK(contains(changed([](Settings& o) { o.filter = PixelFilter::Gaussian; }), "--filter was box and is gaussian"));
  CHECK(contains(changed([](Settings& o) { o.transparent = false; }), "--transparent was on and is off"));
  CHECK(contains(changed([](Settings& o) { o.background = Spectrum(1); }), "--background was none and is 1,1,1"));
  CHECK(contains(changed([](Settings& o) { o.clamp = 1; }), "--clamp was 0 and is 1"));
  CHECK(contains(changed([](Settings& o) { o.photons = 7; }), "--photons was 0 and is 7"));
  CHECK(contains(changed([](Settings& o) { o.keep.quarters = false; }), "keeping quarters was on and is off"));
  // The scene's bytes.
  SceneData data = cornellBox();
  data.contentHash = 77;
  const Scene other(std::move(data));
  Session session(other, makePlan(other, other.data().cameras.at(0), everythingKept("pt", 2), integrators()));
  CHECK_THROWS_WITH_AS(session.resume(state, "old.state"),
                       doctest::Contains("the scene's content was 0000000000000000 and is 000000000000004d"), Error);
}

}  // namespace braid::test_state
