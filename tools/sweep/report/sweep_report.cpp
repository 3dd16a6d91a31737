// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/sweep_report.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "renderer/core/hash.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tools/sweep/report/html.h"
#include "tools/sweep/report/papers.h"
#include "tools/sweep/report/plots.h"
#include "tools/sweep/report/replicates.h"
#include "tools/sweep/table/sweep_error.h"

namespace braid {

namespace {

using Json = nlohmann::ordered_json;

std::string fileName(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-') c = '_';
  constexpr size_t kLongest = 80;  // file systems end names at 255
  if (text.size() <= kLongest) return text;
  ContentHash hash;
  hash.add(text);
  return text.substr(0, kLongest) + "-" + hexString(hash.value());
}

std::string readText(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

Plot makePlot(const SweepTable& table, const SweepSummary& summary, const std::string& scene, bool versusSeconds) {
  Plot plot;
  plot.name = fileName(scene) + (versusSeconds ? "-seconds" : "-spp");
  plot.title = scene + (versusSeconds ? ": error against time" : ": error against samples");
  plot.xLabel = versusSeconds ? "seconds (render + denoise + combine)" : "samples per pixel";
  plot.yLabel = summary.errorColumn;
  plot.versusSeconds = versusSeconds;
  const Ladder ladder = versusSeconds ? summary.timeLadder : availableLadder(table, Ladder::Samples);
  std::vector<std::string> methods{summary.baseline};
  for (const std::string& m : summary.methods)
    if (m != summary.baseline) methods.push_back(m);
  for (const std::string& m : methods) {
    Curve curve = curveOf(table, scene, m, ladder, table.column(summary.errorColumn));
    const auto unplottable = [](const LadderPoint& p) { return !(p.error > 0 && p.low > 0 && p.seconds > 0); };
    curve.erase(std::remove_if(curve.begin(), curve.end(), unplottable), curve.end());
    if (!curve.empty()) plot.series.emplace_back(m, std::move(curve));
  }
  return plot;
}

// SVG texts of the scene's plots; what fails is said once in `warning`.
std::vector<std::string> drawPlots(const std::string& folder, const SweepTable& table, const SweepSummary& summary,
                                   const std::string& scene, std::string& warning) {
  std::vector<std::string> drawn;
  for (bool versusSeconds : {false, true}) {
    const Plot plot = makePlot(table, summary, scene, versusSeconds);
    if (plot.series.empty()) continue;
    writePlotFiles(folder, plot);
    const std::string failure = runGnuplot(folder, plot.name);
    if (failure.empty())
      drawn.push_back(readText(folder + "/" + plot.name + ".svg"));
    else
      warning = failure + ": install gnuplot and run the scripts in " + folder;
  }
  return drawn;
}

const Json* findScene(const Json& record, const std::string& name) {
  for (const Json& s : record["scenes"])
    if (s["name"] == name) return &s;
  return nullptr;
}

ReferenceImage readReferenceImage(const Json& scene) {
  const std::string file = scene["reference"]["file"], integrator = scene["reference"]["integrator"];
  const ImageFile image = readImage(file);
  if (integrator.empty()) return {image.rgb(), {}};
  return {image.rgb(integrator + ".mean"), {image.rgb(integrator + ".halfA"), image.rgb(integrator + ".halfB")}};
}

// Squared bias of every method of a scene that ran with two seeds or more, at the last rung.
std::vector<ReplicateBias> replicateBiases(const std::string& folder, const SweepTable& table,
                                           const SweepSummary& summary, const std::string& scene,
                                           const ReferenceImage& reference) {
  std::vector<ReplicateBias> biases;
  if (!reference.hasHalves()) return biases;
  const size_t column = table.column("relL2_unbiased");
  for (const std::string& method : summary.methods) {
    const MethodSummary* m = summary.find(scene, method);
    if (!m) continue;
    std::vector<Rgb<float>> runs;
    double error = 0;
    for (const SweepRow& r : table.rows) {
      if (r.scene != scene || r.method != method || r.ladder != summary.timeLadder || r.mark != m->curve.back().mark)
        continue;
      std::string path = replicatePath(folder, scene, method, r.ladder, r.mark, r.seed);
      if (!std::filesystem::exists(path)) path = runs.empty() ? imagePath(folder, scene, method, r.ladder, r.mark) : "";
      if (path.empty() || !std::filesystem::exists(path)) continue;
      runs.push_back(readImage(path).rgb());
      error += r.values[column];
    }
    if (runs.size() < 2) continue;
    const SquaredBias bias = relativeSquaredBias(runs, reference);
    biases.push_back({scene, method, static_cast<int>(runs.size()), bias.value, bias.standardError,
                      error / static_cast<double>(runs.size()) - bias.value});
  }
  return biases;
}

ReportScene readScene(const std::string& folder, const SweepSummary& summary, const Json& scene,
                      const Rgb<float>& reference) {
  ReportScene s;
  s.name = scene["name"];
  s.reference = reference;
  for (const std::string& method : summary.methods) {
    const MethodSummary* m = summary.find(s.name, method);
    if (!m) continue;
    const std::string path = imagePath(folder, s.name, method, summary.timeLadder, m->curve.back().mark);
    if (!std::filesystem::exists(path)) continue;
    Rgb<float> image = readImage(path).rgb();
    if (image.width() == s.reference.width() && image.height() == s.reference.height())
      s.images.emplace_back(method, std::move(image));
  }
  return s;
}

std::vector<std::pair<std::string, std::string>> availableIn(const Json& record) {
  const auto text = [](const Json& v) {
    if (!v.is_array()) return v.is_string() ? v.get<std::string>() : v.dump();
    std::string list;
    for (const Json& item : v)
      list += (list.empty() ? "" : ", ") + (item.is_string() ? item.get<std::string>() : item.dump());
    return list;
  };
  std::vector<std::pair<std::string, std::string>> available;
  for (const char* group : {"braid", "machine", "settings", "run"})
    if (record.contains(group))
      for (const auto& [name, value] : record[group].items())
        if (const std::string t = text(value); !t.empty()) available.emplace_back(name, t);
  for (const Json& s : record["scenes"]) {
    const Json& r = s["reference"];
    std::string what = text(r["integrator"]).empty() ? text(r["file"]) : text(r["integrator"]);
    if (r["spp"] > 0) what += ", " + text(r["spp"]) + " spp";
    if (r["relL2OfItsNoise"].is_number())
      what += ", relL2 of its own noise " + shortNumber(r["relL2OfItsNoise"].get<double>());
    available.emplace_back("reference of " + text(s["name"]), what);
  }
  return available;
}

}  // namespace

std::string imagePath(const std::string& folder, const std::string& scene, const std::string& method, Ladder ladder,
                      double mark) {
  return fmt::format("{}/images/{}-{}-{}{}.exr", folder, fileName(scene), fileName(method), toString(ladder), mark);
}

std::string replicatePath(const std::string& folder, const std::string& scene, const std::string& method, Ladder ladder,
                          double mark, uint64_t seed) {
  return fmt::format("{}/images/{}-{}-{}{}-seed{}.exr", folder, fileName(scene), fileName(method), toString(ladder),
                     mark, seed);
}

std::vector<std::string> writeSweepReport(const std::string& folder, const SweepTable& table,
                                          const SweepSummary& summary, const Json& record, bool plots) {
  std::vector<std::string> warnings, sections;
  std::vector<ReplicateBias> biases;
  std::map<std::string, std::string> planned;
  std::string plotWarning;
  for (const std::string& name : summary.scenes) {
    const Json* scene = findScene(record, name);
    if (!scene) continue;
    std::vector<std::string> drawn;
    if (plots) drawn = drawPlots(folder + "/plots", table, summary, name, plotWarning);
    try {
      planned[name] = scene->value("planned", "");
      const ReferenceImage reference = readReferenceImage(*scene);
      for (ReplicateBias& b : replicateBiases(folder, table, summary, name, reference)) biases.push_back(std::move(b));
      ReportScene report = readScene(folder, summary, *scene, reference.mean);
      report.plots = std::move(drawn);
      sections.push_back(sceneSection(report, table, summary));
    } catch (const Error& e) {
      warnings.push_back(fmt::format("the report lacks the scene {}: {}", name, e.what()));
    }
  }
  if (!plotWarning.empty()) warnings.push_back(plotWarning);
  std::string markdown = "# Sweep\n\n" + toMarkdown(summary), overview;
  if (knowsPapers(summary)) {
    const std::vector<PaperSection> papers = comparePapers(table, summary, biases, planned);
    markdown += "\n## Papers\n\n" + toMarkdown(papers);
    overview += "<h2>What the papers claim, and what was measured</h2>\n" + toHtml(papers);
  }
  if (!biases.empty()) {
    markdown += "\n## Squared bias, from runs with different seeds at the last rung\n\n" + toMarkdown(biases);
    overview += "<h2>Squared bias, from runs with different seeds at the last rung</h2>\n" + toHtml(biases);
  }
  sections.insert(sections.begin(), overview);
  writeText(folder + "/summary.md", markdown);
  writeText(folder + "/report.html", reportPage(summary, availableIn(record), sections));
  return warnings;
}

}  // namespace braid
