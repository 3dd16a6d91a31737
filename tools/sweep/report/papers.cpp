// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/papers.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "combiners/learned/network_place.h"
#include "tools/sweep/report/paper_cells.h"

namespace braid {

namespace {

// Names of the methods that the sections speak of.
constexpr const char *kUncorrelated = "uncorrelated", *kUniform = "uncorrelated-uniform",
                     *kCross = "uncorrelated-cross";
constexpr const char *kDouble = "bdpt+sppm/double-shrinkage@sppm", *kSingle = "bdpt+sppm/js@sppm",
                     *kDoubleNeural = "bdpt+sppm/double-shrinkage-neural@sppm";
constexpr const char *kEnsemble = "ensemble@nfor+rdfc", *kAverage = "average@nfor+rdfc",
                     *kOracle = "ensemble-oracle@nfor+rdfc";
constexpr const char *kCurves = "curves@nfor", *kEasy = "easy@nfor", *kInverse = "inverse-variance@nfor",
                     *kIdeal = "ideal@nfor";
constexpr const char* kStopped = "curves:32@nfor";
constexpr double kStop = 32;
// auto with what a plan may keep, and the integrators that it combines.
struct AutoCase {
  const char* method;
  std::vector<std::string> inputs;
};
const AutoCase kAuto{"pt/auto", {"pt"}}, kAutoPhotons{"pt+sppm/auto", {"pt", "sppm"}},
    kAutoCaustics{"bdpt+sppm/auto", {"bdpt", "sppm"}};
const std::vector<std::string> kOneHots{"one-hot-sbf@nfor+rdfc", "one-hot-nfor@nfor+rdfc", "one-hot-post@nfor+rdfc"};
const std::vector<std::string> kShrunk{"box", "nfor", "rdfc", "sppm"};
const std::vector<std::string> kShrunkByNetwork{"box", "nfor", "sppm"};

void add(const CellComparison& some, CellComparison& all) {
  all.cells.insert(all.cells.end(), some.cells.begin(), some.cells.end());
}

std::string shrunk(const std::string& biased, const std::string& method = "js") {
  return (biased == "sppm" ? "pt/" : "") + method + "@" + biased;
}
std::string shrunkByNetwork(const std::string& biased) { return shrunk(biased, "js-neural"); }

std::string inWords(const std::string& biased) { return biased == "box" ? "a 15x15 box filter" : biased; }

class Comparison {
 public:
  Comparison(const SweepTable& table, const SweepSummary& summary, const std::vector<ReplicateBias>& biases,
             const std::map<std::string, std::string>& planned)
      : table_(table), cells_(table, summary), biases_(biases), planned_(planned) {}

  PaperSection jamesStein() const;
  PaperSection uncorrelated() const;
  PaperSection doubleShrinkage() const;
  PaperSection ensemble() const;
  PaperSection curves() const;
  PaperSection automatic() const;

 private:
  // "n of m cells, geometric mean 0.9x, worst 1.2x on pool at 8 spp"
  static std::string describe(const CellComparison& c, double limit);
  static PaperClaim claim(const std::string& text, const CellComparison& c, double limit, double share);
  // Holds when the geometric mean is below the limit.
  static PaperClaim onAverage(const std::string& text, const CellComparison& c, double limit);
  // What is left to gain, of which nothing is claimed.
  static PaperClaim figure(const std::string& text, const CellComparison& c);
  PaperClaim biasClaim() const;
  CellComparison sinceStop() const;
  bool keeps(const std::string& scene, const char* integrator) const {
    const auto found = planned_.find(scene);
    return found != planned_.end() && found->second.find(integrator) != std::string::npos;
  }
  bool keepsPhotons(const std::string& scene) const { return keeps(scene, "sppm"); }
  const AutoCase& autoCase(const std::string& scene) const {
    return !keepsPhotons(scene) ? kAuto : keeps(scene, "bdpt") ? kAutoCaustics : kAutoPhotons;
  }
  PaperCells::Keep whereAutoIs(const AutoCase& of) const {
    return [this, &of](const std::string& s) { return &autoCase(s) == &of; };
  }
  PaperCells::Keep caustic() const {
    return [this](const std::string& s) { return keepsPhotons(s); };
  }
  static PaperClaim gainClaim(const std::string& text, const CellComparison& c);
  // auto on the scenes where the plan keeps photon maps, against another method at equal time.
  CellComparison photonScenesAtEqualTime(const std::string& other) const;
  PaperClaim combiningShare() const;
  PaperClaim errorMapClaim() const;

  const SweepTable& table_;
  PaperCells cells_;
  const std::vector<ReplicateBias>& biases_;
  const std::map<std::string, std::string>& planned_;
};

std::string Comparison::describe(const CellComparison& c, double limit) {
  if (c.cells.empty()) return "not measured";
  const CellRatio worst = c.worst();
  return fmt::format("{} of {} cells; geometric mean {}x, worst {}x ({}, {:g} spp)", c.atMost(limit), c.cells.size(),
                     shortNumber(c.geometricMean()), shortNumber(worst.ratio), worst.scene, worst.spp);
}

PaperClaim Comparison::claim(const std::string& text, const CellComparison& c, double limit, double share) {
  PaperClaim result{text, describe(c, limit), {}};
  if (!c.cells.empty())
    result.holds = static_cast<double>(c.atMost(limit)) >= share * static_cast<double>(c.cells.size());
  return result;
}

PaperClaim Comparison::onAverage(const std::string& text, const CellComparison& c, double limit) {
  PaperClaim result{text, describe(c, limit), {}};
  if (!c.cells.empty()) result.holds = c.geometricMean() < limit;
  return result;
}

PaperClaim Comparison::figure(const std::string& text, const CellComparison& c) {
  if (c.cells.empty()) return {text, "not measured", {}};
  return {text,
          fmt::format("geometric mean {}x, from {}x to {}x ({}, {:g} spp)", shortNumber(c.geometricMean()),
                      shortNumber(c.best()), shortNumber(c.worst().ratio), c.worst().scene, c.worst().spp),
          {}};
}

PaperSection Comparison::jamesStein() const {
  PaperSection s{"Neural James-Stein combiner (Gu et al. 2022), without and with its network", {}};
  for (const std::string& biased : kShrunk)
    s.claims.push_back(
        claim(fmt::format("Shrinking towards {} never has more error than path tracing (from 8 spp)", inWords(biased)),
              cells_.compare(shrunk(biased), {"pt"}, 8), 1.0, 1.0));
  for (const char* biased : {"box", "nfor", "rdfc"})
    s.claims.push_back(onAverage(fmt::format("At the most samples it has less error than {} itself", biased),
                                 cells_.compare(shrunk(biased), {biased}, 8, {}, true), 1.0));
  for (const std::string& biased : kShrunkByNetwork) {
    const std::string text = "With the network, towards " + inWords(biased);
    s.claims.push_back(claim(text + ": never more error than path tracing (from 8 spp)",
                             cells_.compare(shrunkByNetwork(biased), {"pt"}, 8), 1.0, 1.0));
    s.claims.push_back(onAverage(text + ": less error than without it",
                                 cells_.compare(shrunkByNetwork(biased), {shrunk(biased)}, 8), 1.0));
  }
  return s;
}

PaperClaim Comparison::biasClaim() const {
  PaperClaim result{"Negligible bias: squared bias at least 20x below nfor's (runs with different seeds)",
                    "not measured: give more than one seed",
                    {}};
  const auto find = [&](const std::string& scene, const char* method) {
    return std::find_if(biases_.begin(), biases_.end(),
                        [&](const ReplicateBias& b) { return b.scene == scene && b.method == method; });
  };
  // A scene resolves the claim only where the comparison is finer than a 20th of nfor's squared bias.
  size_t scenes = 0, resolved = 0, held = 0;
  double own = 0, theirs = 0;
  for (const std::string& scene : cells_.scenes()) {
    const auto a = find(scene, kUncorrelated), b = find(scene, "nfor");
    if (a == biases_.end() || b == biases_.end()) continue;
    ++scenes;
    if (!(2 * a->standardError < b->squaredBias / 20)) continue;
    ++resolved;
    held += a->squaredBias <= b->squaredBias / 20 + 2 * a->standardError;
    own += a->squaredBias;
    theirs += b->squaredBias;
  }
  if (resolved == 0) {
    if (scenes > 0) result.measured = fmt::format("not resolved on any of {} scenes: give more seeds", scenes);
    return result;
  }
  result.measured = fmt::format("{} of {} scenes that resolve it ({} do not); mean squared bias {} against {}", held,
                                resolved, scenes - resolved, shortNumber(own / static_cast<double>(resolved)),
                                shortNumber(theirs / static_cast<double>(resolved)));
  result.holds = held == resolved;
  return result;
}

PaperSection Comparison::uncorrelated() const {
  PaperSection s{"Input-dependent uncorrelated weighting (Back et al. 2023), of pt and crn", {}};
  s.claims.push_back(claim("Less error than both inputs", cells_.compare(kUncorrelated, {"pt", "crn"}, 8), 1.0, 1.0));
  s.claims.push_back(onAverage("Less error than uniform weights", cells_.compare(kUncorrelated, {kUniform}, 8), 1.0));
  s.claims.push_back(onAverage("Less error than cross weights", cells_.compare(kUncorrelated, {kCross}, 8), 1.0));
  s.claims.push_back(biasClaim());
  return s;
}

PaperSection Comparison::doubleShrinkage() const {
  PaperSection s{"DSCombiner (Zhou et al. 2025), of bdpt and sppm on scenes where the plan keeps photon maps", {}};
  s.claims.push_back(
      onAverage("Less error than both inputs", cells_.compare(kDouble, {"bdpt", "sppm"}, 8, caustic()), 1.0));
  s.claims.push_back(
      onAverage("Less error than single shrinkage", cells_.compare(kDouble, {kSingle}, 8, caustic()), 1.0));
  s.claims.push_back(onAverage("Less error than vertex connection and merging at equal time",
                               cells_.compareAtEqualTime(kDouble, "vcm", caustic()), 1.0));
  s.claims.push_back(onAverage("With the network (double-shrinkage-neural): less error than both inputs",
                               cells_.compare(kDoubleNeural, {"bdpt", "sppm"}, 8, caustic()), 1.0));
  s.claims.push_back(claim("With the network: never more error than bdpt (from 8 spp)",
                           cells_.compare(kDoubleNeural, {"bdpt"}, 8, caustic()), 1.0, 1.0));
  s.claims.push_back(onAverage("With the network: less error than without it",
                               cells_.compare(kDoubleNeural, {kDouble}, 8, caustic()), 1.0));
  return s;
}

PaperSection Comparison::ensemble() const {
  PaperSection s{"Ensemble denoising (Zheng et al. 2021), of nfor and rdfc", {}};
  s.claims.push_back(claim("Less error than the best base in most cells (goal 75 %)",
                           cells_.compare(kEnsemble, {"nfor", "rdfc"}, 4), 1.0, 0.75));
  for (const std::string& other : kOneHots)
    s.claims.push_back(claim("Less error than " + other.substr(0, other.find('@')) + " in most cells",
                             cells_.compare(kEnsemble, {other}, 4), 1.0, 0.5));
  s.claims.push_back(
      claim("Less error than the plain mean in most cells", cells_.compare(kEnsemble, {kAverage}, 4), 1.0, 0.5));
  s.claims.push_back(figure("Weights that are best in hindsight, by a reference: their error over the ensemble's",
                            cells_.compare(kOracle, {kEnsemble}, 4)));
  return s;
}

CellComparison Comparison::sinceStop() const {
  CellComparison c;
  for (const CellRatio& last : cells_.compare(kStopped, {"pt"}, kStop, {}, true).cells) {
    const std::optional<double> now = cells_.error(last.scene, kStopped, last.spp),
                                then = cells_.error(last.scene, kStopped, kStop);
    if (now && then && last.spp > kStop && *then > 0) c.cells.push_back({last.scene, last.spp, *now / *then});
  }
  return c;
}

PaperSection Comparison::curves() const {
  PaperSection s{"Converging blending by convergence curves (Denisova and Bocchi 2024), of pt and nfor", {}};
  s.claims.push_back(onAverage("Less error than the better of noisy and denoised on average, from 16 spp",
                               cells_.compare(kCurves, {"pt", "nfor"}, 16), 1.0));
  s.claims.push_back(onAverage("Less error than choosing by SURE", cells_.compare(kCurves, {kEasy}, 16), 1.0));
  s.claims.push_back(
      onAverage("Less error than inverse-variance weights", cells_.compare(kCurves, {kInverse}, 16), 1.0));
  s.claims.push_back(
      onAverage("Goes on converging after denoising has stopped at 32 spp: the last error over that at the stop",
                sinceStop(), 1.0));
  s.claims.push_back(claim("Converges: at the most samples nowhere more error than path tracing",
                           cells_.compare(kCurves, {"pt"}, 16, {}, true), 1.0, 1.0));
  s.claims.push_back(figure("Ideal blending, by a reference in every pixel: its error over the curves'",
                            cells_.compare(kIdeal, {kCurves}, 16)));
  return s;
}

CellComparison Comparison::photonScenesAtEqualTime(const std::string& other) const {
  CellComparison all;
  for (const AutoCase* of : {&kAutoPhotons, &kAutoCaustics})
    add(cells_.compareAtEqualTime(of->method, other, whereAutoIs(*of)), all);
  return all;
}

PaperClaim Comparison::gainClaim(const std::string& text, const CellComparison& c) {
  PaperClaim result{text, "not measured", {}};
  if (c.cells.empty()) return result;
  const CellRatio worst = c.worst();
  result.measured =
      fmt::format("{}x less error over {} scenes; least {}x ({}), most {}x", shortNumber(1 / c.geometricMean()),
                  c.cells.size(), shortNumber(1 / worst.ratio), worst.scene, shortNumber(1 / c.best()));
  result.holds = worst.ratio <= 1;
  return result;
}

PaperClaim Comparison::combiningShare() const {
  double total = 0, combining = 0;
  for (const SweepRow& r : table_.rows) {
    const char* method = autoCase(r.scene).method;
    const auto last = [&](const SweepRow& other) { return other.method == r.method && other.mark > r.mark; };
    if (r.method != method || r.ladder != Ladder::Samples || std::any_of(table_.rows.begin(), table_.rows.end(), last))
      continue;
    total += r.seconds();
    combining += r.denoise + r.combine;
  }
  PaperClaim result{"Share of run time spent on denoising and combining, at the most samples", "not measured", {}};
  if (total > 0) result.measured = fmt::format("{:.1f} %", 100 * combining / total);
  return result;
}

PaperClaim Comparison::errorMapClaim() const {
  PaperClaim result{"Its estimated error is within a factor of two of the true one", "not measured", {}};
  const auto& columns = table_.columns;
  const auto index = [&](const char* name) {
    return static_cast<size_t>(std::find(columns.begin(), columns.end(), name) - columns.begin());
  };
  const size_t truth = index("relL2_unbiased"), estimate = index("estimated_error");
  if (std::max(truth, estimate) >= columns.size()) return result;
  size_t cells = 0, held = 0;
  double sum = 0;
  for (const SweepRow& r : table_.rows) {
    const double ratio = r.values[estimate] / r.values[truth];
    if (r.method != autoCase(r.scene).method || r.mark < 16 || !(ratio > 0)) continue;
    ++cells;
    held += ratio >= 0.5 && ratio <= 2;
    sum += std::log(ratio);
  }
  if (cells == 0) return result;
  result.measured = fmt::format("{} of {} runs from 16 spp; geometric mean of estimated/true {}", held, cells,
                                shortNumber(std::exp(sum / static_cast<double>(cells))));
  result.holds = held == cells;
  return result;
}

PaperSection Comparison::automatic() const {
  PaperSection s{"braid's own combiner: auto, with the integrators that the plan keeps", {}};
  CellComparison inputs;
  for (const AutoCase* of : {&kAuto, &kAutoPhotons, &kAutoCaustics})
    add(cells_.compare(of->method, of->inputs, 8, whereAutoIs(*of)), inputs);
  s.claims.push_back(claim("At most 1.05x the error of its best integrator, in 95 % of the cells", inputs, 1.05, 0.95));
  s.claims.push_back(gainClaim("Gain over pt at equal time, scenes of path tracing alone",
                               cells_.compareAtEqualTime(kAuto.method, "pt", whereAutoIs(kAuto))));
  s.claims.push_back(gainClaim("Gain over pt at equal time, scenes with photon maps", photonScenesAtEqualTime("pt")));
  s.claims.push_back(onAverage("Less error than vertex connection and merging at equal time, scenes with photon maps",
                               photonScenesAtEqualTime("vcm"), 1.0));
  s.claims.push_back(combiningShare());
  s.claims.push_back(errorMapClaim());
  return s;
}

}  // namespace

std::vector<std::string> paperMethods() {
  std::vector<std::string> methods{"pt", "bdpt", "sppm", "crn", "vcm", "nfor", "rdfc", "box"};
  for (const std::string& biased : kShrunk) methods.push_back(shrunk(biased));
  for (const char* name : {kUncorrelated, kUniform, kCross, kDouble, kSingle, kEnsemble, kAverage, kOracle, kCurves,
                           kEasy, kInverse, kStopped, kIdeal, kAuto.method, kAutoPhotons.method, kAutoCaustics.method})
    methods.push_back(name);
  methods.insert(methods.end(), kOneHots.begin(), kOneHots.end());
  if (networkSkipReason("js-neural").empty())
    for (const std::string& biased : kShrunkByNetwork) methods.push_back(shrunkByNetwork(biased));
  if (networkSkipReason("double-shrinkage-neural").empty()) methods.push_back(kDoubleNeural);
  return methods;
}

bool knowsPapers(const SweepSummary& summary) {
  return std::any_of(summary.methods.begin(), summary.methods.end(), [](const std::string& m) {
    return m == kUncorrelated || m == kDouble || m == kEnsemble || m == kCurves || m == shrunk("nfor");
  });
}

std::vector<PaperSection> comparePapers(const SweepTable& table, const SweepSummary& summary,
                                        const std::vector<ReplicateBias>& biases,
                                        const std::map<std::string, std::string>& planned) {
  const Comparison c(table, summary, biases, planned);
  return {c.automatic(), c.jamesStein(), c.uncorrelated(), c.doubleShrinkage(), c.ensemble(), c.curves()};
}

}  // namespace braid
