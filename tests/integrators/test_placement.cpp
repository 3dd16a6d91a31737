// SPDX-License-Identifier: Apache-2.0
// Samples that are placed by the error: the map, the film's estimates, and renders that use them.
#include <filesystem>

#include "braid/place_samples.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/state_file.h"
#include "renderer/film/placed_sums.h"
#include "tests/support/statistics/calibration.h"

namespace braid::test_placement {

using namespace test;

namespace {

constexpr uint64_t kRounds = 48;  // three maps begin before: after 16 and 32 rounds

const Scene& cornell() {
  static const Scene scene(cornellBox());
  return scene;
}

Settings placedSettings(int width, int height, uint64_t spp, const std::string& placement = "none") {
  Settings s = settingsFor(width, height, spp);
  s.placement = placement;
  s.keep.features = true;
  return s;
}

Plan planOf(const Scene& scene, const Settings& settings) {
  return makePlan(scene, scene.data().cameras.at(0), settings, integrators());
}

FilmState stateOf(const Settings& settings) {
  Session session(cornell(), planOf(cornell(), settings));
  if (session.plan().placesSamples) session.placeBy(errorsForPlacement(settings.placement));
  session.advance();
  return session.release();
}

bool sameSums(FilmState& a, FilmState& b) {
  RawSums x = a.sharedSums(), y = b.sharedSums();
  for (FilmState* f : {&a, &b}) {
    RawSums& list = f == &a ? x : y;
    f->placement->listMap(list);
    for (EstimateState& e : f->estimates)
      for (const RawSum& s : e.rawSums()) list.push_back(s);
  }
  bool same = x.size() == y.size();
  for (size_t i = 0; same && i < x.size(); ++i) same = x[i].name == y[i].name && x[i].plane->data == y[i].plane->data;
  return same;
}

// Placed by the fourth powers of errors: numbers of samples that follow the values more closely than any real judge
// lets them.
RenderResult renderedByExtremes(const Settings& settings) {
  Session session(cornell(), planOf(cornell(), settings));
  session.placeBy([](const Estimates& half) {
    Plane<float> error = varianceOverBrightness(half);
    for (float& v : error.data) v = v * v * v * v;
    return error;
  });
  return session.run();
}

// A film without light whose passes are over, for maps of errors that a test makes up.
FilmState madeUpFilm(int width, int height, double perBucket) {
  FilmState film;
  film.buckets = 4;
  film.window = {0, 0, width, height};
  film.fullWidth = width;
  film.fullHeight = height;
  film.placement.emplace(width, height);
  for (Plane<double>& c : film.placement->count) c = Plane<double>(c.width, c.height, perBucket);
  EstimateState& e = film.estimates.emplace_back();
  e.name = "pt";
  e.sums = Accumulator(width, height, 4, false, KeptSquares::Halves);
  return film;
}

// Pixels' mean number of samples in the passes from one map to the next, both counted as 1 a pass.
double meanSamples(const SamplePlacement& p, uint64_t map) {
  double sum = 0, pixels = 0;
  for (uint64_t pass = map; pass < 2 * map; ++pass) {
    const std::vector<int> samples = samplesOfPass(p, pass);
    for (size_t t = 0; t < p.tiles(); ++t) {
      sum += samples[t] * p.pixels(t);
      pixels += p.pixels(t);
    }
  }
  return sum / pixels;
}

}  // namespace

TEST_CASE("placement: a map spends all samples, one tile's alone if need be, and starves no tile") {
  for (const auto& [width, height] : {std::pair{40, 24}, std::pair{37, 19}, std::pair{3, 5}, std::pair{1, 1}}) {
    for (const uint64_t round : {uint64_t(16), uint64_t(128)}) {
      FilmState film = madeUpFilm(width, height, static_cast<double>(round) / 4);
      const auto oneTile = [&](const Estimates& half) {
        Plane<float> error(half.width, half.height);
        error[0] = 1;
        return error;
      };
      const double gain = makePlacementMap(film, round, oneTile);
      const SamplePlacement& p = *film.placement;
      CHECK(gain >= 1);
      CHECK(meanSamples(p, round) <= 1 + 1e-9);
      CHECK(meanSamples(p, round) > (p.tiles() > 4 ? 0.9 : 0.0));
      for (int h = 0; h < 2; ++h)
        for (size_t t = 0; t < p.tiles(); ++t) CHECK(p.weight[static_cast<size_t>(h)][t] >= 0);
      if (p.tiles() > 4) CHECK(p.weight[0][0] > 1);
    }
  }
}

TEST_CASE("placement: where nothing errs, or nothing finite is known, all pixels get as many samples") {
  for (const float value : {0.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    FilmState film = madeUpFilm(40, 24, 4);
    makePlacementMap(film, 16, [&](const Estimates& half) { return Plane<float>(half.width, half.height, value); });
    for (uint64_t pass = 16; pass < 32; ++pass)
      for (const int n : samplesOfPass(*film.placement, pass)) CHECK(n == 1);
  }
}

TEST_CASE("placement: between two maps tiles double their samples, evenly in every bucket") {
  FilmState film = madeUpFilm(64, 64, 4);
  makePlacementMap(film, 16, [&](const Estimates& half) {
    Plane<float> error(half.width, half.height);
    for (size_t i = 0; i < error.size(); ++i) error[i] = static_cast<float>(i * i);
    return error;
  });
  SamplePlacement& p = *film.placement;
  for (uint64_t pass = 16; pass < 32; ++pass) {
    const std::vector<int> samples = samplesOfPass(p, pass);
    for (size_t t = 0; t < p.tiles(); ++t) p.count[pass % 4][t] += samples[t];
  }
  bool differ = false;
  for (size_t t = 0; t < p.tiles(); ++t) {
    for (size_t k = 0; k < 4; ++k) {
      const double doublings = std::log2(p.count[k][t] / 4);
      CHECK(doublings == std::floor(doublings));
      CHECK(p.count[k][t] == p.count[k % 2][t]);
      differ = differ || p.count[k][t] != 8;
    }
  }
  CHECK(differ);
  CHECK(std::fabs(meanSamples(p, 16) - 1) < 0.02);
}

TEST_CASE("placement: with as many samples everywhere, placed estimates are the ordinary ones") {
  for (const SamplerKind sampler : {SamplerKind::Sobol, SamplerKind::Independent}) {
    Settings settings = placedSettings(21, 13, 16);
    settings.sampler = sampler;
    const FilmState film = stateOf(settings);
    const Accumulator& sums = film.estimates[0].sums;
    REQUIRE(film.placement->even());
    const PlacedSums placed(sums, *film.placement);
    const bool low = sampler == SamplerKind::Sobol;
    const auto near = [](const Rgb<float>& a, const Rgb<float>& b, float tolerance) {
      bool ok = a.size() == b.size();
      for (size_t c = 0; ok && c < 3; ++c)
        for (size_t i = 0; i < a.size(); ++i)
          ok = ok && std::fabs(a[c][i] - b[c][i]) <= tolerance * std::fabs(b[c][i]) + 1e-12f;
      return ok;
    };
    CHECK(near(placed.mean(), sums.mean(), 1e-6f));
    for (int h = 0; h < 2; ++h) CHECK(sameBits(placed.halfMean(h), sums.halfMean(h)));
    for (int k = 0; k < 4; ++k) CHECK(sameBits(placed.bucketMean(k), sums.bucketMean(k)));
    // Halves' own variances instead of that of all samples: the same on average, and with four equal buckets the same
    // spread between them.
    const auto sumOf = [](const Rgb<float>& image) {
      double sum = 0;
      for (const float v : image[1].data) sum += static_cast<double>(v);
      return sum;
    };
    const double ratio = sumOf(placed.variance(low)) / sumOf(sums.variance(low));
    CHECK(ratio > 0.9);
    CHECK(ratio < 1.1);
  }
}

TEST_CASE("placement: the first rounds are those of a render without it, to the bit") {
  Settings plain = placedSettings(24, 16, 16, "");
  const RenderResult a = render(cornell(), plain), b = render(cornell(), placedSettings(24, 16, 16));
  CHECK(sameBits(a.estimates->estimates[0].mean, b.estimates->estimates[0].mean));
  CHECK(sameBits(a.estimates->estimates[0].half[1], b.estimates->estimates[0].half[1]));
  CHECK(b.estimates->estimates[0].samples.empty());
}

TEST_CASE("placement: the same bits on any number of threads, resumed from any round, by either judge") {
  for (const std::string judge : {"none", "auto"}) {
    Settings settings = placedSettings(64, 48, kRounds, judge);
    settings.threads = 1;
    FilmState whole = stateOf(settings);
    CHECK(!whole.placement->even());
    for (const int threads : {2, 5}) {
      settings.threads = threads;
      FilmState other = stateOf(settings);
      CHECK(sameSums(whole, other));
    }
    const std::string file =
        (std::filesystem::temp_directory_path() / ("braid_placement_" + judge + ".state")).string();
    for (const uint64_t stop : {16, 23, 32, 37}) {
      settings.spp = stop;
      writeStateFile(file, stateOf(settings));
      settings.spp = kRounds;
      Session session(cornell(), planOf(cornell(), settings));
      session.placeBy(errorsForPlacement(judge));
      session.resume(readStateFile(file), file);
      session.advance();
      FilmState resumed = session.release();
      INFO(judge, " from round ", stop);
      CHECK(sameSums(whole, resumed));
    }
    std::filesystem::remove(file);
  }
}

TEST_CASE("placement: states with and without it do not mix, and films with other numbers of samples add up") {
  FilmState placed = stateOf(placedSettings(24, 16, kRounds)), plain = stateOf(placedSettings(24, 16, kRounds, ""));
  CHECK(difference(placed.identity, plain.identity, true).find(kPlacementOption) != std::string::npos);
  CHECK(!holdSameSums(placed, plain));
  Settings other = placedSettings(24, 16, 32);
  other.seed = 5;
  FilmState more = stateOf(other);
  const SamplePlacement before = *placed.placement;
  addShare(placed, more);
  for (size_t t = 0; t < before.tiles(); ++t)
    CHECK(placed.placement->total(t) == before.total(t) + more.placement->total(t));
  const Estimates sum = estimatesOf(placed, true);
  for (const float v : sum.estimates[0].mean[1].data) CHECK(std::isfinite(v));
}

TEST_CASE("placement: it is left out with a reason where it cannot be followed") {
  Settings several = placedSettings(16, 16, 64), share = several, clear = several, bdpt = several;
  several.integrators = {"pt", "bdpt"};
  share.firstRound = 8;
  clear.transparent = true;
  bdpt.integrators = {"bdpt"};
  for (const Settings& s : {several, share, clear, bdpt}) {
    const Plan plan = planOf(cornell(), s);
    CHECK(!plan.placesSamples);
    CHECK(plan.text().find("- placement of samples: ") != std::string::npos);
  }
  CHECK(planOf(cornell(), placedSettings(16, 16, 64)).text().find("+ placement of samples: ") != std::string::npos);
}

// Over seeds, blocks of 8 x 8 pixels and channels; the limit is that of a false alarm in 10⁴ sets of seeds.
TEST_CASE("placement: the mean is unbiased where few samples carry much of the light") {
  constexpr int kSeeds = 200, kSide = 24, kBlocks = 9;
  int uneven = 0;
  double mean[2][3 * kBlocks] = {}, square[2][3 * kBlocks] = {};
  for (int seed = 0; seed < kSeeds; ++seed)
    for (int placed = 0; placed < 2; ++placed) {
      Settings s = placedSettings(kSide, kSide, kRounds, placed ? "none" : "");
      s.seed = static_cast<uint64_t>(seed + 1000 * placed);
      s.sampler = SamplerKind::Independent;
      const RenderResult r = placed ? renderedByExtremes(s) : render(cornell(), s);
      uneven += r.estimates->estimates[0].samples.empty() ? 0 : 1;
      const std::vector<PixelWindow> blocks = blocksOf(r, 8);
      for (size_t b = 0; b < blocks.size(); ++b)
        for (size_t c = 0; c < 3; ++c) {
          const double v = meanOver(r, c, blocks[b]).value;
          mean[placed][3 * b + c] += v / kSeeds;
          square[placed][3 * b + c] += v * v / kSeeds;
        }
    }
  double worst = 0;
  for (size_t i = 0; i < 3 * kBlocks; ++i) {
    Measured of[2];
    for (int p = 0; p < 2; ++p)
      of[p] = {mean[p][i], std::sqrt(std::max(0.0, square[p][i] - mean[p][i] * mean[p][i]) / (kSeeds - 1))};
    worst = std::max(worst, zScore(of[0], of[1]));
  }
  CHECK(uneven == kSeeds);
  MESSAGE("largest z ", worst, ", limit ", zLimit(3 * kBlocks));
  CHECK(worst < zLimit(3 * kBlocks));
}

TEST_CASE("placement: reported variances are true and halves independent") {
  for (const SamplerKind sampler : {SamplerKind::Independent, SamplerKind::Sobol}) {
    int uneven = 0;
    const auto rendered = [&](uint64_t seed) {
      Settings s = clampedSettings(32, 24, 64, sampler, seed);
      s.placement = "none";
      RenderResult r = renderedByExtremes(s);
      uneven += r.estimates->estimates[0].samples.empty() ? 0 : 1;
      return r;
    };
    Calibration calibration(rendered(1000));
    for (uint64_t seed = 0; seed < 128; ++seed) calibration.add(rendered(seed));
    CHECK(uneven > 100);
    const bool independent = sampler == SamplerKind::Independent;
    checkCalibration(calibration, independent ? "placed, independent" : "placed, sobol", false);
  }
}

TEST_CASE("placement: every method runs on estimates with other numbers of samples") {
  Settings s = placedSettings(64, 48, kRounds);
  s.keep = KeptBuffers::everything();
  const RenderResult r = render(cornell(), s);
  REQUIRE(!r.estimates->estimates[0].samples.empty());
  int ran = 0;
  for (const std::unique_ptr<Method>& method : makeMethods()) {
    const std::string name = method->name();
    const PipelineResult result = runPipeline(*r.estimates, {name}, {});
    const PipelineOutput* made = result.find(name);
    INFO(name);
    if (!made || !made->ran()) continue;
    ++ran;
    bool finite = true;
    for (size_t c = 0; c < 3; ++c)
      for (const float v : made->result.image.mean[c].data) finite = finite && std::isfinite(v);
    CHECK(finite);
  }
  CHECK(ran >= 12);
}

}  // namespace braid::test_placement
