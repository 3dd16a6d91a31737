// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_folder.h"

#include <algorithm>
#include <filesystem>
#include <tuple>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tools/sweep/report/sweep_report.h"
#include "tools/sweep/sweep_record.h"
#include "version.h"

namespace braid {

namespace {

using Json = nlohmann::ordered_json;

void makeFolder(const std::string& path) {
  std::error_code failure;
  std::filesystem::create_directories(path, failure);
  if (failure) throw Error(ExitCode::OutputFailed, fmt::format("{}: cannot be created: {}", path, failure.message()));
}

void addOnce(std::vector<std::string>& list, const std::string& name) {
  if (std::find(list.begin(), list.end(), name) == list.end()) list.push_back(name);
}

}  // namespace

SweepFolder::SweepFolder(const SweepOptions& options, const Measurement& measurement, Warn warn)
    : o_(options), measurement_(measurement), warn_(std::move(warn)) {}

void SweepFolder::open(const Settings& settings, const std::vector<SweepMethod>& methods) {
  for (const char* folder : {"", "/references", "/images", "/plots"}) makeFolder(o_.output + folder);
  const Json now = sweepSettings(o_, settings, measurement_);
  record_ = {{"schema", 1}, {"scenes", Json::array()}};
  if (std::filesystem::exists(path("sweep.csv"))) table_ = readSweepTable(path("sweep.csv"));
  // A run that ended before its first row binds nobody.
  if (!table_.rows.empty()) readEarlierRows(now);
  table_.columns = measurement_.columns();
  record_["braid"] = {{"version", BRAID_VERSION}, {"build", BRAID_BUILD_FLAGS}};
  record_["machine"] = machineRecord();
  record_["settings"] = now;
  Json names = Json::array();
  for (const SweepMethod& m : methods) names.push_back(m.name);
  record_["run"] = {{"methods", names},  {"spp", o_.spp},   {"time", o_.time},
                    {"seeds", o_.seeds}, {"seed", o_.seed}, {"referenceSpp", o_.referenceSpp}};
  writeRecord();
  writeSweepTable(path("sweep.csv"), table_);
}

void SweepFolder::readEarlierRows(const Json& settings) {
  record_ = readRecord(path("sweep.json"));
  requireSameSettings(path("sweep.json"), record_["settings"], settings);
  if (record_["machine"] != machineRecord())
    warn_("the rows of this folder were measured on another machine: times differ");
  if (table_.columns != measurement_.columns())
    throw Error(ExitCode::Usage, path("sweep.csv") + ": has other columns; choose another folder (-o)");
}

void SweepFolder::writeRecord() const { writeText(path("sweep.json"), record_.dump(2) + "\n"); }

void SweepFolder::keep(const SweepRow& row, const Rgb<float>& image, bool lastRung) {
  if (lastRung && !image.empty()) {
    ExrOptions exr;
    exr.floatHeadline = true;
    const std::string file = row.seed == o_.seed
                                 ? imagePath(o_.output, row.scene, row.method, row.ladder, row.mark)
                                 : replicatePath(o_.output, row.scene, row.method, row.ladder, row.mark, row.seed);
    writeExr(file, {}, image, nullptr, exr);
  }
  appendSweepRow(path("sweep.csv"), row);
  table_.rows.push_back(row);
}

void SweepFolder::record(const SweepScene& scene, const ReferenceFrame& frame) {
  const Json now = sceneRecord(scene, frame);
  Json& scenes = record_["scenes"];
  const auto before =
      std::find_if(scenes.begin(), scenes.end(), [&](const Json& s) { return s["name"] == scene.name; });
  if (before == scenes.end()) {
    scenes.push_back(now);
  } else {
    requireSameScene(path("sweep.json"), *before, now);
    *before = now;
  }
  writeRecord();
}

void SweepFolder::sortRows(const std::vector<std::string>& scenes, const std::vector<std::string>& methods) {
  const auto place = [](const std::vector<std::string>& order, const std::string& name) {
    return std::find(order.begin(), order.end(), name) - order.begin();
  };
  const auto key = [&](const SweepRow& r) {
    return std::tuple(place(scenes, r.scene), r.scene, place(methods, r.method), r.method, r.ladder, r.mark, r.seed);
  };
  std::stable_sort(table_.rows.begin(), table_.rows.end(),
                   [&](const SweepRow& a, const SweepRow& b) { return key(a) < key(b); });
}

void SweepFolder::finish(const std::vector<std::string>& scenes, const std::vector<std::string>& methods,
                         std::ostream& out) {
  sortRows(scenes, methods);
  writeSweepTable(path("sweep.csv"), table_);
  if (table_.rows.empty()) return;
  std::vector<std::string> allScenes, allMethods;
  for (const SweepRow& r : table_.rows) {
    addOnce(allScenes, r.scene);
    addOnce(allMethods, r.method);
  }
  const SweepSummary summary = summarise(table_, allScenes, allMethods);
  record_["metrics"] = Json::array();
  for (const Metric* m : measurement_.metrics)
    record_["metrics"].push_back(
        {{"name", m->name}, {"description", m->description}, {"largerIsBetter", m->largerIsBetter}});
  record_["summary"] = toJson(summary);
  writeRecord();
  for (const std::string& line : writeSweepReport(o_.output, table_, summary, record_, !o_.noPlots)) warn_(line);
  out << toMarkdown(summary);
  if (!o_.view.quiet)
    fmt::print(stderr, "Saved: {} {} {}\n", path("sweep.csv"), path("summary.md"), path("report.html"));
}

}  // namespace braid
