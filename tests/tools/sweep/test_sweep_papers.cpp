// SPDX-License-Identifier: Apache-2.0
// `braid sweep --preset papers`: what is asked for, what rows make of the papers' claims, bias from replicates.
#include <cmath>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>

#include <doctest/doctest.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "combiners/learned/network_place.h"
#include "tools/sweep/report/paper_cells.h"
#include "tools/sweep/report/papers.h"
#include "tools/sweep/sweep.h"
#include "tools/sweep/table/sweep_error.h"
#include "tools/sweep/methods/sweep_pipeline.h"
#include "tools/sweep/sweep_preset.h"

namespace braid::test_sweep_papers {

using test::Folder;

namespace {

struct RowSpec {
  const char *scene, *method;
  double spp, seconds, error;
};

SweepTable tableOf(const std::vector<RowSpec>& rows) {
  SweepTable t;
  t.columns = {"relL2_unbiased", "estimated_error", "better_pixels"};
  for (const RowSpec& spec : rows) {
    SweepRow r;
    r.scene = spec.scene;
    r.method = spec.method;
    r.mark = spec.spp;
    r.spp = static_cast<uint64_t>(spec.spp);
    r.render = spec.seconds;
    r.values = {spec.error, 1.5 * spec.error, std::nan("")};
    t.rows.push_back(r);
  }
  return t;
}

const PaperClaim* findClaim(const std::vector<PaperSection>& sections, const std::string& text) {
  for (const PaperSection& s : sections)
    for (const PaperClaim& c : s.claims)
      if (c.claim.find(text) != std::string::npos) return &c;
  return nullptr;
}

Rgb<float> noisy(std::mt19937& random, float mean, float deviation) {
  std::normal_distribution<float> normal(mean, deviation);
  Rgb<float> image(128, 128);
  for (size_t c = 0; c < 3; ++c)
    for (float& v : image[c].data) v = normal(random);
  return image;
}

SweepTable threeScenes() {
  return tableOf({{"room", "pt", 16, 1, 0.4},
                  {"room", "js@nfor", 16, 1, 0.2},
                  {"room", "js-neural@nfor", 16, 1, 0.18},
                  {"room", "pt/auto", 16, 1, 0.1},
                  {"room", "ensemble@nfor+rdfc", 16, 1, 0.3},
                  {"room", "ensemble-oracle@nfor+rdfc", 16, 1, 0.15},
                  {"pool", "pt", 16, 1, 8},
                  {"pool", "js@nfor", 16, 1, 9},
                  {"pool", "bdpt", 16, 1, 4},
                  {"pool", "sppm", 16, 1, 0.1},
                  {"pool", "bdpt+sppm/auto", 16, 1, 0.12},
                  {"hall", "pt", 16, 1, 0.9},
                  {"hall", "sppm", 16, 1, 0.5},
                  {"hall", "pt+sppm/auto", 16, 1, 0.3}});
}

std::vector<ReplicateBias> biasesOfTwoScenes() {
  return {{"room", "uncorrelated", 2, 1e-5, 1e-6, 1e-3},
          {"room", "nfor", 2, 1e-3, 1e-6, 1e-3},
          {"pool", "uncorrelated", 2, 1e-2, 1e-1, 1},
          {"pool", "nfor", 2, 1e-2, 1e-1, 1}};
}

}  // namespace

TEST_CASE("Cells are ratios of means over seeds, in cells that all methods have") {
  SweepTable t = tableOf({{"a", "pt", 8, 1, 0.4},
                          {"a", "pt", 16, 2, 0.2},
                          {"a", "js@nfor", 8, 1.5, 0.1},
                          {"a", "js@nfor", 16, 3, 0.3},
                          {"b", "pt", 8, 1, 0.5}});
  t.rows.push_back(t.rows[2]);
  t.rows.back().seed = 1;
  t.rows.back().values[0] = 0.3;
  const SweepSummary summary = summarise(t, {"a", "b"}, {"pt", "js@nfor"});
  const PaperCells cells(t, summary);
  const CellComparison c = cells.compare("js@nfor", {"pt"}, 8);
  REQUIRE(c.cells.size() == 2);
  CHECK(c.cells[0].ratio == doctest::Approx(0.5));
  CHECK(c.cells[1].ratio == doctest::Approx(1.5));
  CHECK(c.atMost(1) == 1);
  CHECK(c.worst().spp == 16);
  CHECK(c.geometricMean() == doctest::Approx(std::sqrt(0.75)));
  CHECK(cells.compare("js@nfor", {"pt"}, 16).cells.size() == 1);
  CHECK(cells.compare("js@nfor", {"pt", "nfor"}, 8).cells.empty());
  // pt ends after 2 s; there js@nfor lies between its rungs of 0.2 and 0.3 in log-log.
  const CellComparison equal = cells.compareAtEqualTime("js@nfor", "pt");
  REQUIRE(equal.cells.size() == 1);
  CHECK(equal.cells[0].ratio == doctest::Approx(std::exp(std::log(2 / 1.5) / std::log(2.0) * std::log(1.5))));
}

TEST_CASE("Claims hold or not by their cells, and say when nothing was measured") {
  const SweepTable t = threeScenes();
  const SweepSummary summary =
      summarise(t, {"room", "pool", "hall"},
                {"pt", "js@nfor", "js-neural@nfor", "pt/auto", "bdpt", "sppm", "bdpt+sppm/auto", "pt+sppm/auto",
                 "ensemble@nfor+rdfc", "ensemble-oracle@nfor+rdfc"});
  CHECK(knowsPapers(summary));
  CHECK(!knowsPapers(summarise(t, {"room"}, {"pt"})));
  const std::vector<ReplicateBias> biases = biasesOfTwoScenes();
  const auto sections = comparePapers(t, summary, biases, {{"room", "pt"}, {"pool", "sppm+bdpt"}, {"hall", "sppm+pt"}});
  REQUIRE(sections.size() == 6);
  const PaperClaim* js = findClaim(sections, "Shrinking towards nfor never");
  REQUIRE(js);
  CHECK(js->holds == false);
  CHECK(js->measured.find("1 of 2 cells") == 0);
  CHECK(js->measured.find("(pool, 16 spp)") != std::string::npos);
  const PaperClaim* neural = findClaim(sections, "With the network, towards nfor: less error than without it");
  REQUIRE(neural);
  CHECK(neural->measured.find("1 of 1 cells; geometric mean 0.9x") == 0);
  CHECK(neural->holds == true);
  // auto's inputs are those that the plan keeps: on pool its error is 1.2 times sppm's.
  const PaperClaim* best = findClaim(sections, "error of its best integrator");
  REQUIRE(best);
  CHECK(best->measured.find("2 of 3 cells") == 0);
  CHECK(best->holds == false);
  const PaperClaim* photons = findClaim(sections, "scenes with photon maps");
  REQUIRE(photons);
  CHECK(photons->measured.find("over 2 scenes; least 3x (hall)") != std::string::npos);
  const PaperClaim* gain = findClaim(sections, "scenes of path tracing alone");
  REQUIRE(gain);
  CHECK(gain->measured.find("4x less error over 1 scenes") == 0);
  CHECK(gain->holds == true);
  const PaperClaim* error = findClaim(sections, "Its estimated error");
  REQUIRE(error);
  CHECK(error->holds == true);
  CHECK(error->measured.find("3 of 3 runs") == 0);
  // Only the room resolves a twentieth of nfor's squared bias.
  const PaperClaim* bias = findClaim(sections, "Negligible bias");
  REQUIRE(bias);
  CHECK(bias->holds == true);
  CHECK(bias->measured.find("1 of 1 scenes") == 0);
  const PaperClaim* missing = findClaim(sections, "Less error than one-hot-sbf");
  REQUIRE(missing);
  CHECK(missing->measured == "not measured");
  CHECK(!missing->holds);
  const PaperClaim* left = findClaim(sections, "best in hindsight");
  REQUIRE(left);
  CHECK(left->measured.find("geometric mean 0.5x, from 0.5x to 0.5x (room, 16 spp)") == 0);
  CHECK(!left->holds);
  const std::string html = toHtml(sections), markdown = toMarkdown(sections);
  CHECK(html.find("not measured") != std::string::npos);
  CHECK(markdown.find("| no |") != std::string::npos);
}

TEST_CASE("Squared bias comes from products of different runs, without the noise of runs and reference") {
  // Truth 1, bias 0.1, runs with deviation 0.3, reference halves with 0.02: so little that the noise of the denominator
  // mean_RGB(R)² + 0.01 does not matter.
  std::mt19937 random(3);
  ReferenceImage r;
  for (Rgb<float>& half : r.half) half = noisy(random, 1, 0.02f);
  r.mean = r.half[0];
  std::vector<Rgb<float>> biased, unbiased;
  for (int k = 0; k < 4; ++k) {
    biased.push_back(noisy(random, 1.1f, 0.3f));
    unbiased.push_back(noisy(random, 1, 0.3f));
  }
  // 4 standard errors: a false alarm in 16,000 each.
  const SquaredBias with = relativeSquaredBias(biased, r), without = relativeSquaredBias(unbiased, r);
  CHECK(std::fabs(with.value - 0.01 / 1.01) < 4 * with.standardError);
  CHECK(std::fabs(without.value) < 4 * without.standardError);
  // Products of pairs of runs, 6 of them, and with the reference's halves: the standard error itself within 30 %.
  const double product = 0.09 * 0.09 / 6 + 0.0004 * 0.0004 + 2 * 0.0004 * 0.09 / 4;
  const double expected = std::sqrt(product / (3.0 * 128 * 128));
  CHECK(without.standardError == doctest::Approx(expected).epsilon(0.3));
  CHECK(std::isnan(relativeSquaredBias(biased, {r.mean, {}}).value));
}

TEST_CASE("The preset fills in what was not given, and every method of it can run") {
  SweepOptions o;
  o.spp = parseLadder("4", false);
  applyPreset("papers", {"--spp"}, o);
  CHECK(o.spp == std::vector<double>{4});
  CHECK((o.view.size == FrameSize{192, 108}));
  CHECK(o.methods == paperMethods());
  const auto integrators = makeIntegrators();
  CHECK(sweepMethods(o.methods, pointersTo(integrators)).size() == o.methods.size());
  CHECK_THROWS_AS(applyPreset("paper", {}, o), Error);

  const Folder folder;
  o.scenes = {test::sourcePath("scenes/cornell.glb")};
  o.output = (folder.path / "sweep").string();
  o.spp = parseLadder("8,32,64", false);
  o.view.size = {16, 12};
  o.referenceSpp = 64;
  o.noPlots = o.view.quiet = true;
  std::ostringstream out;
  REQUIRE(runSweep(o, out) == 0);
  std::ifstream in(o.output + "/summary.md");
  const std::string summary{std::istreambuf_iterator<char>(in), {}};
  CHECK(summary.find("### Ensemble denoising") != std::string::npos);
  CHECK(summary.find("| cornell | uncorrelated | 2 |") != std::string::npos);
  // Only what needs photon maps has nothing to measure in a box without glass: eight claims, three of them at equal
  // time, and, where networks do not run, six of js-neural. Whether the other claims at equal time are measured depends
  // on milliseconds: the methods' times must overlap.
  size_t unmeasured = 0, atEqualTime = 0;
  std::istringstream lines(summary);
  for (std::string line; std::getline(lines, line);)
    if (line.find("not measured") != std::string::npos)
      ++(line.find("at equal time") == std::string::npos ? unmeasured : atEqualTime);
  CHECK(unmeasured == (networkSkipReason("js-neural").empty() ? 5 : 11));
  CHECK(atEqualTime >= 3);
}

}  // namespace braid::test_sweep_papers
