// SPDX-License-Identifier: Apache-2.0
// States: a render that is interrupted and resumed from a file, or split into shares and added up, is the render that
// was neither; and no broken file is taken for a state.
#include <cstring>

#include <doctest/doctest.h>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/state_file.h"
#include "renderer/session/rendering_revision.h"
#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"

namespace braid::test_state {

using test::contains;
using test::Folder;
using test::integrators;
using test::readText;
namespace fs = std::filesystem;

namespace {

// A box with a sphere of mirror-like metal: something for photons and splats, and rays that miss.
const Scene& scene() {
  static const Scene built = [] {
    SceneData data = cornellBox();
    TriangleMesh sphere;
    addSphere(sphere, Vec3(0, 0.6f, 0.4f), 0.4f, 2);
    Material metal = diffuseMaterial(Spectrum(0.9f));
    metal.metallic = 1;
    metal.roughness = 0.1f;
    data.materials.push_back(metal);
    addMesh(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1));
    return Scene(std::move(data));
  }();
  return built;
}

Settings everythingKept(const std::string& names, uint64_t spp) {
  Settings s = test::settingsFor(14, 11, spp);
  s.integrators = {names};
  if (names == "all") {
    s.integrators.clear();
    for (const Integrator* i : integrators()) s.integrators.push_back(i->name());
  }
  s.keep = KeptBuffers::everything();
  s.transparent = true;
  return s;
}

Session sessionFor(const Settings& settings) {
  return Session(scene(), makePlan(scene(), scene().data().cameras.at(0), settings, integrators()));
}

template <class T>
bool sameBits(const Plane<T>& a, const Plane<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data.data(), b.data.data(), a.size() * sizeof(T)) == 0);
}

template <class T>
bool sameBits(const Rgb<T>& a, const Rgb<T>& b) {
  return sameBits(a[0], b[0]) && sameBits(a[1], b[1]) && sameBits(a[2], b[2]);
}

template <class T>
bool sameBits(const std::vector<T>& a, const std::vector<T>& b) {
  bool same = a.size() == b.size();
  for (size_t i = 0; same && i < a.size(); ++i) same = sameBits(a[i], b[i]);
  return same;
}

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

// Everything but the seconds.
void checkSame(const FilmState& a, const FilmState& b, bool history = true) {
  REQUIRE(a.estimates.size() == b.estimates.size());
  for (size_t i = 0; i < a.estimates.size(); ++i) {
    const EstimateState &x = a.estimates[i], &y = b.estimates[i];
    INFO(x.name);
    CHECK(x.name == y.name);
    CHECK(x.passes == y.passes);
    CHECK(sameBits(x.sums.sums(), y.sums.sums()));
    CHECK(sameBits(x.sums.sumOfSquares(), y.sums.sumOfSquares()));
    for (int h = 0; h < 2; ++h) CHECK(sameBits(x.sums.biasSum(h), y.sums.biasSum(h)));
    CHECK(sameBits(x.sums.biasSumOfSquares(), y.sums.biasSumOfSquares()));
    REQUIRE(x.parts.has_value() == y.parts.has_value());
    if (x.parts) {
      CHECK(sameBits(x.parts->direct().sums(), y.parts->direct().sums()));
      CHECK(sameBits(x.parts->direct().sumOfSquares(), y.parts->direct().sumOfSquares()));
      CHECK(sameBits(x.parts->indirectSumOfSquares(), y.parts->indirectSumOfSquares()));
    }
    CHECK(x.sums.rejected() == y.sums.rejected());
    CHECK(x.sums.clampedSplats() == y.sums.clampedSplats());
    for (int k = 0; k < a.buckets; ++k) CHECK(x.sums.passesInBucket(k) == y.sums.passesInBucket(k));
    if (!history) continue;
    REQUIRE(x.history.size() == y.history.size());
    for (size_t h = 0; h < x.history.size(); ++h) {
      CHECK(x.history[h].passes == y.history[h].passes);
      CHECK(sameBits(x.history[h].variance, y.history[h].variance));
    }
  }
  REQUIRE(a.features.has_value() == b.features.has_value());
  if (a.features) {
    for (int h = 0; h < 2; ++h) CHECK(sameBits(a.features->sums(h), b.features->sums(h)));
    CHECK(sameBits(a.features->sumsOfSquares(), b.features->sumsOfSquares()));
    CHECK(a.features->passes() == b.features->passes());
  }
  REQUIRE(a.coverage.has_value() == b.coverage.has_value());
  if (a.coverage) {
    CHECK(sameBits(a.coverage->sums(), b.coverage->sums()));
    CHECK(a.coverage->passes() == b.coverage->passes());
  }
}

FilmState stateOf(const Settings& settings) {
  Session session = sessionFor(settings);
  session.run();
  return session.state();
}

std::string refusal(const std::string& path) {
  try {
    readStateFile(path);
  } catch (const Error& e) {
    CHECK(e.code() == ExitCode::BadInput);
    CHECK(std::string(e.what()).rfind(path + ":", 0) == 0);
    CHECK(!contains(e.what(), "\n"));
    return e.what();
  }
  return "";
}

// Pixels of the images whose files are tampered with.
constexpr size_t kTinyPixels = 4 * 2;

// The bytes of a state with another header: sizes and checksum are made to fit again.
std::string withHeader(const std::string& bytes, const std::string& from, const std::string& to) {
  unsigned long long headerBytes = 0, planeBytes = 0;
  std::sscanf(bytes.c_str(), "braid-state 3 %llu %llu", &headerBytes, &planeBytes);
  const size_t begin = bytes.find('\n') + 1;
  std::string header = bytes.substr(begin, headerBytes);
  const size_t at = header.find(from);
  REQUIRE_MESSAGE(at != std::string::npos, from);
  header.replace(at, from.size(), to);
  const std::string first = "braid-state 3 " + std::to_string(header.size()) + ' ' + std::to_string(planeBytes) + '\n';
  const std::string planes = bytes.substr(begin + headerBytes, planeBytes);
  ContentHash hash;  // by the steps of the writer: one for each plane
  hash.add(first);
  hash.add(header);
  const std::string table = bytes.substr(begin, headerBytes);
  size_t offset = 0;
  for (size_t line = table.find("\nplane "); line != std::string::npos; line = table.find("\nplane ", line + 1)) {
    const size_t value = table.compare(table.find('\n', line + 1) - 2, 2, "64") == 0 ? 8 : 4;
    hash.add(planes.data() + offset, kTinyPixels * value);
    offset += kTinyPixels * value;
  }
  REQUIRE(offset == planes.size());
  return first + header + planes + hexString(hash.value()) + '\n';
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

TEST_CASE("A file gives back every word and number") {
  const Folder folder;
  FilmState state = stateOf(everythingKept("sppm", 3));
  state.identity.version = "0.1.0";
  state.identity.build = "a compiler, with spaces";
  state.identity.isa = "";
  state.identity.options.push_back({"--env", "a file %20 with\nall sorts \x7f of \xc3\xa9"});
  state.seconds = 0.1 + 0.2;
  state.estimates[0].seconds = 1e-300;
  state.attributes = {{"text", Attribute::Kind::String, "two\nlines", 0, 0, {}},
                      {"negative", Attribute::Kind::Int, "", -5, 0, {}},
                      {"third", Attribute::Kind::Float, "", 0, 1.0 / 3, {}},
                      {"matrix", Attribute::Kind::Matrix, "", 0, 0, std::vector<float>(16, 0.1f)},
                      {"white", Attribute::Kind::Chromaticities, "", 0, 0, std::vector<float>(8, -1e-30f)}};
  const std::string file = folder.path / "s.state";
  writeStateFile(file, state);
  const FilmState read = readStateFile(file);
  checkSame(state, read);
  CHECK(read.identity.version == state.identity.version);
  CHECK(read.identity.build == state.identity.build);
  CHECK(read.identity.isa.empty());
  CHECK(read.identity.options == state.identity.options);
  CHECK(read.identity.sceneHash == state.identity.sceneHash);
  CHECK(read.seconds == state.seconds);
  CHECK(read.estimates[0].seconds == 1e-300);
  CHECK(read.estimates[0].unbiased == state.estimates[0].unbiased);
  REQUIRE(read.attributes.size() == 5);
  CHECK(read.attributes[0].text == "two\nlines");
  CHECK(read.attributes[1].integer == -5);
  CHECK(read.attributes[2].number == 1.0 / 3);
  CHECK(read.attributes[3].values == state.attributes[3].values);
  CHECK(read.attributes[4].values == state.attributes[4].values);
  CHECK(readStateHeader(file).estimates[0].passes == state.estimates[0].passes);
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

TEST_CASE("Cut, damaged and foreign files are refused, never believed") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  Settings small = everythingKept("sppm", 2);
  small.width = 4;
  small.height = 2;
  writeStateFile(file, stateOf(small));
  const std::string good = readText(file);
  CHECK(refusal(file).empty());
  const std::string broken = folder.path / "broken.state";
  const auto refusalOf = [&](const std::string& bytes) {
    folder.write("broken.state", bytes);
    return refusal(broken);
  };
  for (size_t size = 0; size < good.size(); size += size < 3000 ? 37 : 211) {
    INFO(size);
    CHECK(!refusalOf(good.substr(0, size)).empty());
  }
  for (size_t at = 0; at < good.size(); at += at < 3000 ? 5 : 97) {
    INFO(at);
    std::string bytes = good;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << at % 8));
    CHECK(!refusalOf(bytes).empty());
  }
  CHECK(contains(refusalOf(good + "x"), "cut short or damaged"));
  CHECK(contains(refusalOf(good.substr(0, good.size() - 1)), "cut short or damaged"));
  std::string planes = good;
  planes[good.size() - 400] = static_cast<char>(planes[good.size() - 400] ^ 1);
  CHECK(contains(refusalOf(planes), "is damaged: its checksum"));
  CHECK(contains(refusalOf(""), "is no state of braid"));
  CHECK(contains(refusalOf(std::string(100000, '\0')), "is no state of braid"));
  CHECK(contains(refusalOf("\x89PNG\r\n\x1a\n"), "is no state of braid"));
  CHECK(contains(refusalOf("braid-state 1 10 10\n"), "has state format 1"));
  CHECK(contains(refusalOf("braid-state 3 18446744073709551615 18446744073709551615\n"), "damaged"));
  CHECK(contains(refusalOf("braid-state 3 -1 5\n"), "damaged"));
  CHECK(contains(refusal(folder.path / "none.state"), "does not exist"));
  CHECK(contains(refusal(folder.path), "is not a file"));
  CHECK(contains(refusal("/dev/zero"), "is not a file"));
}

TEST_CASE("Headers that lie are refused before anything is allocated for them") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  Settings small = everythingKept("sppm", 2);
  small.width = 4;
  small.height = 2;
  writeStateFile(file, stateOf(small));
  const std::string good = readText(file);
  const auto refusalWith = [&](const std::string& from, const std::string& to) {
    folder.write("lie.state", withHeader(good, from, to));
    return refusal(folder.path / "lie.state");
  };
  CHECK(refusalWith("sppm", "sppm").empty());  // the helper itself makes valid files
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 65536 4096 0 0 65536 4096"), "size of the image"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 65536 65536 0 0 65536 65536"), "268 million"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 4 2 0 0 4 3"), "header line 5"));
  CHECK(contains(refusalWith("pixels 4 2 0 0 4 2", "pixels 4 2 3 0 3 2"), "not a number from 4 to 4"));
  CHECK(contains(refusalWith("buckets 4", "buckets 3"), "three buckets"));
  CHECK(contains(refusalWith("buckets 4", "buckets 2"), "not one per bucket"));
  CHECK(contains(refusalWith("buckets 4", "buckets 99999999999999999999"), "not a number"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:3"), "passes and counts disagree"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:1 1:2"), "not in order"));
  CHECK(contains(refusalWith("passes 0:2", "passes 2:0"), "are none"));
  CHECK(contains(refusalWith("passes 0:2", "passes 0:999999999999999999"), "not a number of at most"));
  CHECK(contains(refusalWith("passes 0:2", "passes"), "passes and counts disagree"));
  CHECK(contains(refusalWith("counts 1 1 0 0", "counts 1 1 0"), "not one per bucket"));
  CHECK(contains(refusalWith("plane coverage float64", "plane coverage float32"), "not expected"));
  CHECK(contains(refusalWith("plane coverage float64\n", ""), "planes are missing"));
  CHECK(contains(refusalWith("plane sppm.sum0.R float64", "plane sppm.sum9.R float64"), "not expected"));
  CHECK(contains(refusalWith("seconds ", "seconds nan "), "negative or not finite"));
  CHECK(contains(refusalWith("seed 0", "seed 0 0"), "more than expected"));
  CHECK(contains(refusalWith("seed 0", "sead 0"), "unknown word"));
  CHECK(contains(refusalWith("seed 0", "seed"), "ends too early"));
  CHECK(contains(refusalWith("seed 0", "passes 0:1"), "before any estimate"));
  CHECK(contains(refusalWith("option --size", "option --s%ze"), "broken escape"));
}

TEST_CASE("A failed write leaves the earlier file and no other") {
  const Folder folder;
  const std::string file = folder.path / "s.state";
  const FilmState state = stateOf(everythingKept("pt", 1));
  writeStateFile(file, state);
  {
    // Begun, never finished.
    const auto unfinished = beginStateFile(file, stateOf(everythingKept("pt", 2)));
    CHECK(readStateFile(file).rounds() == 1);
  }
  CHECK(readStateFile(file).rounds() == 1);
  CHECK(std::distance(fs::directory_iterator(folder.path), {}) == 1);
  CHECK_THROWS_WITH_AS(writeStateFile(folder.path / "no" / "s.state", state), doctest::Contains("create the folder"),
                       Error);
  CHECK_THROWS_AS(writeStateFile(folder.path, state), Error);
}

}  // namespace braid::test_state
