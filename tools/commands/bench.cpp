// SPDX-License-Identifier: Apache-2.0
// `braid bench`: throughput against bare Embree rays, seconds of methods, and what publishing adds to a render.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/stopwatch.h"
#include "tools/bench/bench_combining.h"
#include "tools/bench/bench_efficiency.h"
#include "tools/bench/bench_publishing.h"
#include "tools/bench/bench_rays.h"
#include "tools/bench/builtin_scenes.h"
#include "tools/options/cli.h"
#include "tools/options/combining.h"
#include "tools/options/syntax/help.h"
#include "tools/options/open_scene.h"
#include "tools/options/syntax/option_checks.h"
#include "version.h"

namespace braid {

namespace {

struct BenchOptions {
  std::vector<std::string> scenes, combine, publish, variants;
  std::string references, referenceIntegrator = "bdpt";
  uint64_t referenceSpp = 1024;
  SampleChoice samples;
  FrameSize size{512, 512};
  std::string isa = "avx2";
  int repeats = 5;
  bool json = false;
};

struct SceneSource {
  std::string name;
  std::function<SceneData()> load;
};

std::vector<SceneSource> sourcesOf(const BenchOptions& o) {
  std::vector<SceneSource> sources;
  const std::vector<SceneSource> builtin{{"builtin:cornell", [] { return cornellBox(); }},
                                         {"builtin:million", [] { return cornellBox(1'000'000); }}};
  for (const std::string& file : o.scenes) {
    const auto known =
        std::find_if(builtin.begin(), builtin.end(), [&](const SceneSource& b) { return b.name == file; });
    if (known != builtin.end())
      sources.push_back(*known);
    else
      sources.push_back({file, [file] {
                           SceneChoice choice;
                           choice.file = file;
                           return loadScene(choice);
                         }});
  }
  if (sources.empty()) sources = o.combine.empty() && o.publish.empty() ? builtin : std::vector{builtin[0]};
  return sources;
}

OpenedScene sceneOf(const SceneSource& source, const BenchOptions& o) {
  SceneChoice choice;
  choice.isa = o.isa;
  const Stopwatch clock;
  SceneData data = source.load();
  OpenedScene opened;
  opened.loadSeconds = clock.seconds();
  opened.camera = chooseCamera(data, choice);
  opened.scene = buildScene(std::move(data), choice, opened.camera);
  return opened;
}

// Denoisers and combiners instead of rays.
int runCombiningBench(const BenchOptions& o, const Settings& settings) {
  nlohmann::json all = nlohmann::json::array();
  for (const SceneSource& source : sourcesOf(o)) {
    const OpenedScene opened = sceneOf(source, o);
    const nlohmann::json methods = benchCombining(*opened.scene, opened.camera, settings, o.combine, o.repeats);
    all.push_back({{"scene", source.name}, {"methods", methods}});
    if (o.json) continue;
    fmt::print("{}: {}x{}, {} spp\n", source.name, settings.width, settings.height, settings.spp);
    for (const nlohmann::json& m : methods)
      if (m.contains("skipReason"))
        fmt::print("  {}: {}\n", m["method"].get<std::string>(), m["skipReason"].get<std::string>());
      else
        fmt::print("  {}: {:.3f} s, {:.2f} s a megapixel\n", m["method"].get<std::string>(), m["seconds"].get<double>(),
                   m["secondsPerMegapixel"].get<double>());
  }
  if (o.json)
    fmt::print("{}\n", nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"combining", all}}).dump(2));
  return 0;
}

void sayPublishing(const std::string& scene, const Settings& settings, const nlohmann::json& r) {
  const auto number = [&](const char* name) { return r[name].get<double>(); };
  const double seconds = number("publishedSeconds");
  const auto percent = [&](double part) { return 100 * part / seconds; };
  fmt::print(
      "{}: {}x{}, {} spp: {:.2f} s, with {:.1f} publications ({:.1f} combined) {:.2f} s: {:+.1f} %, of processor time "
      "{:+.1f} %; publishing and combining take {:.1f} % of it: "
      "{:.1f} on the way, {:.1f} the last combining, {:.1f} its larger file\n",
      scene, settings.width, settings.height, settings.spp, number("seconds"), number("publications"),
      number("combinedPublications"), seconds, 100 * number("overhead"), 100 * number("processorOverhead"),
      100 * number("share"), percent(number("publishingSeconds")), percent(number("lastCombineSeconds")),
      percent(std::max(0.0, number("lastWriteSeconds") - number("plainWriteSeconds"))));
}

// What is published while a render goes on and combined at its end, against the passes and a plain file.
int runPublishingBench(const BenchOptions& o, const Settings& settings) {
  nlohmann::json all = nlohmann::json::array();
  for (const SceneSource& source : sourcesOf(o)) {
    const OpenedScene opened = sceneOf(source, o);
    nlohmann::json r = benchPublishing(*opened.scene, opened.camera, settings, o.publish, o.repeats);
    if (!o.json) sayPublishing(source.name, settings, r);
    r["scene"] = source.name;
    all.push_back(std::move(r));
  }
  if (o.json)
    fmt::print("{}\n", nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"publishing", all}}).dump(2));
  return 0;
}

void sayRays(const std::string& scene, const nlohmann::json& r) {
  fmt::print("{}: {} triangles, {:.2f} rays a path\n", scene, r["triangles"].dump(), r["raysPerPath"].get<double>());
  fmt::print("  {:.2f} M paths/s, {:.2f} M rays/s, {:.0f} % of the time inside Embree\n",
             r["pathsPerSecond"].get<double>() * 1e-6, r["raysPerSecond"].get<double>() * 1e-6,
             100 * r["embreeShare"].get<double>());
  fmt::print(
      "  the same rays one by one by Embree alone: {:.2f} M rays/s in the order of the render (ratio {:.3f}), {:.2f} "
      "M rays/s in random order (ratio {:.3f})\n",
      r["rawRaysPerSecond"].get<double>() * 1e-6, r["ratio"].get<double>(),
      r["rawIncoherentRaysPerSecond"].get<double>() * 1e-6, r["incoherentRatio"].get<double>());
  const nlohmann::json& photons = r["photons"];
  fmt::print(
      "  photons on one thread: {:.2f} M segments/s, {:.2f} M gather queries/s with {:.1f} photons each, {:.3f} s to "
      "sort a pass\n",
      photons["segmentsPerSecond"].get<double>() * 1e-6, photons["queriesPerSecond"].get<double>() * 1e-6,
      photons["photonsPerQuery"].get<double>(), photons["sortSeconds"].get<double>());
  fmt::print(
      "  load {:.3f} s, hierarchies {:.3f} s, {:.1f} bytes a triangle in hierarchies, {:.1f} in all; film {} bytes a "
      "pixel; peak {:.0f} MiB\n",
      r["loadSeconds"].get<double>(), r["hierarchySeconds"].get<double>(), r["hierarchyBytesPerTriangle"].get<double>(),
      r["sceneBytesPerTriangle"].get<double>(), r["filmBytesPerPixel"].dump(),
      r["peakMemoryBytes"].get<double>() / 1048576.0);
}

int runRayBench(const BenchOptions& o, Settings settings) {
  settings.keep.features = false;
  nlohmann::json all = nlohmann::json::array();
  for (const SceneSource& source : sourcesOf(o)) {
    const OpenedScene opened = sceneOf(source, o);
    nlohmann::json r = benchRays(*opened.scene, opened.camera, settings, o.repeats);
    r["scene"] = source.name;
    r["loadSeconds"] = opened.loadSeconds;
    if (!o.json) sayRays(source.name, r);
    all.push_back(std::move(r));
  }
  if (o.json)
    fmt::print("{}\n",
               nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"isa", o.isa}, {"results", all}}).dump(2));
  return 0;
}

void sayEfficiency(const std::string& scene, const nlohmann::json& variants) {
  fmt::print("{}:\n", scene);
  for (const nlohmann::json& v : variants) {
    const auto number = [&](const char* name) { return v[name].get<double>(); };
    fmt::print("  {:<40} relL2 {:.3e}, HDR-FLIP {:.4f}, {:.2f} processor s ({:.2f} s): error x time {:.3f}\n",
               v["variant"].get<std::string>(), number("relL2"), number("hdrFlip"), number("processorSeconds"),
               number("seconds"), number("ratio"));
  }
}

// Variants of a render against each other, over all scenes.
int runEfficiencyBench(const BenchOptions& o) {
  EfficiencyBench bench;
  for (const std::string& text : o.variants) bench.variants.push_back(parseVariant(text, o.samples));
  bench.view.size = o.size;
  bench.repeats = o.repeats;
  bench.references =
      o.references.empty() ? (std::filesystem::temp_directory_path() / "braid-references").string() : o.references;
  bench.referenceIntegrator = o.referenceIntegrator;
  bench.referenceSpp = o.referenceSpp;
  nlohmann::json all = nlohmann::json::array();
  std::vector<double> logarithms(bench.variants.size(), 0.0);
  const std::vector<SceneSource> sources = sourcesOf(o);
  for (const SceneSource& source : sources) {
    const OpenedScene opened = sceneOf(source, o);
    const nlohmann::json variants = benchEfficiency(*opened.scene, opened.camera, bench);
    for (size_t v = 0; v < variants.size(); ++v) logarithms[v] += std::log(variants[v]["ratio"].get<double>());
    if (!o.json) sayEfficiency(source.name, variants);
    all.push_back({{"scene", source.name}, {"variants", variants}});
  }
  if (o.json) {
    fmt::print("{}\n", nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"efficiency", all}}).dump(2));
    return 0;
  }
  if (sources.size() < 2) return 0;
  fmt::print("geometric mean over {} scenes:\n", sources.size());
  for (size_t v = 0; v < bench.variants.size(); ++v)
    fmt::print("  {:<40} error x time {:.3f}\n", bench.variants[v].text,
               std::exp(logarithms[v] / static_cast<double>(sources.size())));
  return 0;
}

int runBench(const BenchOptions& o) {
  if (!o.variants.empty()) return runEfficiencyBench(o);
  SceneChoice view;
  view.size = o.size;
  Settings settings = makeSettings(view, o.samples);
  if (!o.combine.empty()) return runCombiningBench(o, settings);
  if (!o.publish.empty()) return runPublishingBench(o, settings);
  return runRayBench(o, settings);
}

}  // namespace

void addBench(CLI::App& app, Action& action) {
  auto options = std::make_shared<BenchOptions>();
  BenchOptions& o = *options;
  o.samples.maxDepth = 10;
  CLI::App* command = app.add_subcommand("bench", "Measure throughput against bare Embree rays in the same run");
  command->footer(
      "Examples:\n"
      "  braid bench                 the built-in Cornell box and its million-triangle variant\n"
      "  braid bench scene.glb --json\n"
      "  braid bench scene.glb --efficiency='--integrator pt' --efficiency='--integrator bdpt'");
  command->add_option("SCENE", o.scenes, "glTF files, builtin:cornell or builtin:million (default: both built-in ones)")
      ->type_name("FILE");
  addSize(*command, o.size);
  command->add_option("--repeats", o.repeats, "Interleaved measurements; the median counts")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000));
  addIsa(*command, o.isa);
  addList(*command, "--combine", o.combine,
          "Measure these denoisers and combiners, separated by commas, instead of rays");
  addList(*command, "--publish", o.publish,
          "Measure what publishing images combined by these adds to the passes, instead of rays");
  command
      ->add_option("--efficiency", o.variants,
                   "Compare error x processor time of this variant of a render with that of the first one: options of "
                   "render about samples and combining, in quotes (repeatable)")
      ->allow_extra_args(false)
      ->type_name("OPTIONS");
  command->add_option("--references", o.references, "Where --efficiency keeps its references")->type_name("FOLDER");
  command->add_option("--reference-integrator", o.referenceIntegrator, "Renders the references of --efficiency")
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--reference-spp", o.referenceSpp, "Samples of the references of --efficiency")
      ->capture_default_str()
      ->check(wholeNumber(2, uint64_t(1) << 24));
  command->add_flag("--json", o.json, "As JSON");
  addSampleOptions(*command, o.samples);
  showFirst(*command, "Measurement", {"--size", "--repeats", "--combine", "--publish", "--efficiency", "--json"});
  command->callback([options, &action] { action = [options] { return runBench(*options); }; });
}

}  // namespace braid
