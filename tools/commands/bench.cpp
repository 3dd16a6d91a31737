// SPDX-License-Identifier: Apache-2.0
// `braid bench`: throughput as ratios within one run. The rays that a render traced are recorded and traced again by
// bare Embree calls; the ratio of the two rates, and the share of the render that Embree's part would take, mean the
// same on every machine.
#include <algorithm>
#include <fstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "integrators/registry.h"
#include "integrators/sppm/sppm_throughput.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "tools/bench/bench_combining.h"
#include "tools/bench/bench_publishing.h"
#include "tools/bench/builtin_scenes.h"
#include "tools/options/cli.h"
#include "tools/options/option_checks.h"
#include "version.h"

namespace braid {

namespace {

struct BenchOptions {
  std::vector<std::string> scenes;
  SampleChoice samples;
  std::string size = "512x512", isa = "avx2", combine, publish;
  int repeats = 5;
  bool json = false;
};

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

// Peak resident memory of the process in bytes, from /proc.
uint64_t peakMemory() {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line))
    if (line.rfind("VmHWM:", 0) == 0) return std::stoull(line.substr(6)) * 1024;
  return 0;
}

// Traces one recorded ray by Embree alone.
void traceRaw(RTCScene scene, const RecordedRay& r) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  query.ray.org_x = r.origin.x;
  query.ray.org_y = r.origin.y;
  query.ray.org_z = r.origin.z;
  query.ray.tnear = 0;
  query.ray.dir_x = r.direction.x;
  query.ray.dir_y = r.direction.y;
  query.ray.dir_z = r.direction.z;
  query.ray.time = 0;
  query.ray.tfar = r.tmax;
  query.ray.mask = ~0u;
  query.ray.id = 0;
  query.ray.flags = 0;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  if (r.shadow)
    rtcOccluded1(scene, &context, &query.ray);
  else
    rtcIntersect1(scene, &context, &query);
}

// Traces the recorded rays as the renderer does: in packets of neighbours of one kind.
void traceLikeRenderer(const Accel& accel, const std::vector<RecordedRay>& rays) {
  RayBatch batch;
  ShadowBatch shadows;
  std::array<RayHit, kBatch> hits;
  std::array<bool, kBatch> hidden;
  for (size_t i = 0; i < rays.size();) {
    const bool shadow = rays[i].shadow;
    int count = 0;
    for (; count < kBatch && i < rays.size() && rays[i].shadow == shadow; ++count, ++i)
      shadow ? shadows.set(count, rays[i]) : batch.set(count, rays[i]);
    if (shadow)
      accel.occluded(shadows, count, hidden.data());
    else
      accel.intersect(batch, count, hits.data());
  }
}

// A fixed random order: neighbours in memory have nothing in common.
void shuffle(std::vector<RecordedRay>& rays, uint64_t seed) {
  for (size_t i = rays.size(); i > 1; --i) std::swap(rays[i - 1], rays[mix64(seed + i) % i]);
}

struct SceneSource {
  std::string name;
  std::function<SceneData()> load;
};

// The halves of photon mapping by themselves, for one thread: medians over the repeats.
nlohmann::json benchPhotons(const TransportContext& context, const Plan& plan, int repeats) {
  std::vector<double> segments, queries, sorting;
  PhotonThroughput last;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    last = measurePhotonThroughput(context, plan);
    segments.push_back(last.segmentsPerSecond);
    queries.push_back(last.queriesPerSecond);
    sorting.push_back(last.sortSeconds);
  }
  return {{"segmentsPerSecond", median(segments)},
          {"queriesPerSecond", median(queries)},
          {"photonsPerQuery", last.photonsPerQuery},
          {"storedPerPath", last.storedPerPath},
          {"sortSeconds", median(sorting)}};
}

nlohmann::json benchScene(const SceneSource& source, const BenchOptions& o, const Settings& settings) {
  const Stopwatch loading;
  SceneData data = source.load();
  const double loadSeconds = loading.seconds();
  const CameraData camera = chooseCamera(data, {});
  SceneOptions sceneOptions;
  sceneOptions.isa = o.isa == "auto" ? "" : o.isa;
  const Scene scene(std::move(data), sceneOptions);
  const auto integrators = makeIntegrators();
  const Plan plan = makePlan(scene, camera, settings, pointersTo(integrators));
  const TransportContext context(scene, settings.lightStrategy);
  const Integrator& integrator = *plan.integrators.front().integrator;

  std::vector<double> renderRates, rawRates, ratios, pathRates, shares, incoherentRates, incoherentRatios;
  uint64_t rayCount = 0;
  withThreads(settings.threads, [&] {
    PassTarget target(plan.window.width(), plan.window.height(), integrator.splats(), plan.kept.features);
    Accumulator film(plan.window.width(), plan.window.height(), plan.buckets());
    std::vector<std::vector<RecordedRay>> recorded;
    integrator.renderPass({context, plan, 0, nullptr, nullptr, &recorded}, target);
    std::vector<std::vector<RecordedRay>> shuffled = recorded;
    for (size_t i = 0; i < shuffled.size(); ++i) shuffle(shuffled[i], i);
    uint64_t recordedRays = 0;
    for (const auto& tile : recorded) recordedRays += tile.size();
    const uint64_t passes = std::max<uint64_t>(1, settings.spp / static_cast<uint64_t>(o.repeats));
    // Each repeat times both, one after the other, so that a change of clock or load hits both alike.
    for (int repeat = 0; repeat < o.repeats; ++repeat) {
      PassStatistics statistics;
      const Stopwatch rendering;
      for (uint64_t k = 0; k < passes; ++k) {
        target.clear();
        integrator.renderPass({context, plan, film.passes(), nullptr, &statistics, nullptr}, target);
        film.commit(film.passes(), target);
      }
      const double renderSeconds = rendering.seconds();
      rayCount = (statistics.rays + statistics.shadowRays) / passes;
      const auto timeRaw = [&](const std::vector<std::vector<RecordedRay>>& tiles) {
        const Stopwatch tracing;
        parallelFor(tiles.size(), [&](size_t i) {
          for (const RecordedRay& r : tiles[i]) traceRaw(scene.accel().handle(), r);
        });
        return tracing.seconds();
      };
      const double rawSeconds = timeRaw(recorded), incoherentSeconds = timeRaw(shuffled);
      const Stopwatch inEmbree;
      parallelFor(recorded.size(), [&](size_t i) { traceLikeRenderer(scene.accel(), recorded[i]); });
      shares.push_back(inEmbree.seconds() * static_cast<double>(passes) / renderSeconds);
      const double renderRate = static_cast<double>(statistics.rays + statistics.shadowRays) / renderSeconds;
      const double rawRate = static_cast<double>(recordedRays) / rawSeconds;
      renderRates.push_back(renderRate);
      rawRates.push_back(rawRate);
      ratios.push_back(renderRate / rawRate);
      incoherentRates.push_back(static_cast<double>(recordedRays) / incoherentSeconds);
      incoherentRatios.push_back(renderRate / incoherentRates.back());
      pathRates.push_back(static_cast<double>(statistics.paths) / renderSeconds);
    }
  });
  const auto pixels = static_cast<double>(plan.window.width()) * plan.window.height();
  const double ratio = median(ratios);
  const auto sceneBytes = static_cast<double>(scene.accel().bytes() + scene.geometryBytes());
  return {{"scene", source.name},
          {"triangles", scene.traits().triangles},
          {"pathsPerSecond", median(pathRates)},
          {"raysPerSecond", median(renderRates)},
          {"rawRaysPerSecond", median(rawRates)},
          {"ratio", ratio},
          {"rawIncoherentRaysPerSecond", median(incoherentRates)},
          {"incoherentRatio", median(incoherentRatios)},
          {"embreeShare", median(shares)},
          {"raysPerPath", static_cast<double>(rayCount) / pixels},
          {"loadSeconds", loadSeconds},
          {"hierarchySeconds", scene.buildTimes().hierarchy},
          {"hierarchyBytesPerTriangle", static_cast<double>(scene.accel().bytes()) /
                                            std::max<double>(1, static_cast<double>(scene.traits().triangles))},
          {"sceneBytesPerTriangle", sceneBytes / std::max<double>(1, static_cast<double>(scene.traits().triangles))},
          {"filmBytesPerPixel", plan.filmBytesPerPixel},
          {"lightBytes", context.lights.bytes()},
          {"photons", benchPhotons(context, plan, o.repeats)},
          {"peakMemoryBytes", peakMemory()}};
}

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

std::pair<std::unique_ptr<Scene>, CameraData> openScene(const SceneSource& source, const BenchOptions& o) {
  SceneChoice choice;
  choice.isa = o.isa;
  SceneData data = source.load();
  const CameraData camera = chooseCamera(data, choice);
  return {buildScene(std::move(data), choice, camera), camera};
}

// Denoisers and combiners instead of rays.
int runCombiningBench(const BenchOptions& o, const Settings& settings) {
  nlohmann::json all = nlohmann::json::array();
  for (const SceneSource& source : sourcesOf(o)) {
    const auto [scene, camera] = openScene(source, o);
    const nlohmann::json methods = benchCombining(*scene, camera, settings, splitList(o.combine), o.repeats);
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

void tellPublishing(const std::string& scene, const Settings& settings, const nlohmann::json& r) {
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
    const auto [scene, camera] = openScene(source, o);
    nlohmann::json r = benchPublishing(*scene, camera, settings, o.publish, o.repeats);
    if (!o.json) tellPublishing(source.name, settings, r);
    r["scene"] = source.name;
    all.push_back(std::move(r));
  }
  if (o.json)
    fmt::print("{}\n", nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"publishing", all}}).dump(2));
  return 0;
}

int runBench(const BenchOptions& o) {
  SceneChoice view;
  view.size = o.size;
  Settings settings = makeSettings(view, o.samples);
  if (!o.combine.empty()) return runCombiningBench(o, settings);
  if (!o.publish.empty()) return runPublishingBench(o, settings);
  settings.keep.features = false;
  const std::vector<SceneSource> sources = sourcesOf(o);
  nlohmann::json all = nlohmann::json::array();
  for (const SceneSource& source : sources) {
    const nlohmann::json r = benchScene(source, o, settings);
    all.push_back(r);
    if (o.json) continue;
    fmt::print("{}: {} triangles, {:.2f} rays a path\n", source.name, r["triangles"].dump(),
               r["raysPerPath"].get<double>());
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
        r["loadSeconds"].get<double>(), r["hierarchySeconds"].get<double>(),
        r["hierarchyBytesPerTriangle"].get<double>(), r["sceneBytesPerTriangle"].get<double>(),
        r["filmBytesPerPixel"].dump(), r["peakMemoryBytes"].get<double>() / 1048576.0);
  }
  if (o.json)
    fmt::print("{}\n",
               nlohmann::json({{"schema", 1}, {"build", BRAID_BUILD_FLAGS}, {"isa", o.isa}, {"results", all}}).dump(2));
  return 0;
}

}  // namespace

void addBench(CLI::App& app, Action& action) {
  auto options = std::make_shared<BenchOptions>();
  BenchOptions& o = *options;
  o.samples.maxDepth = 10;
  CLI::App* command = app.add_subcommand("bench", "Measure throughput against bare Embree rays in the same run");
  command->footer(
      "Example:\n  braid bench                 the built-in Cornell box and its million-triangle variant\n  braid "
      "bench scene.glb --json");
  command->add_option("SCENE", o.scenes, "glTF files, builtin:cornell or builtin:million (default: both built-in ones)")
      ->type_name("FILE");
  command->add_option("--size", o.size, "Frame in pixels")
      ->capture_default_str()
      ->check(readBy(parseSize))
      ->type_name("WIDTHxHEIGHT");
  command->add_option("--repeats", o.repeats, "Interleaved measurements; the median counts")
      ->capture_default_str()
      ->check(wholeNumber(1, 1000));
  command->add_option("--isa", o.isa, "Instruction set for Embree: avx2, avx512, sse4.2, or auto")
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--combine", o.combine,
                   "Measure these denoisers and combiners, separated by commas, instead of rays")
      ->type_name("NAMES");
  command
      ->add_option("--publish", o.publish,
                   "Measure what publishing images combined by these adds to the passes, instead of rays")
      ->type_name("NAMES");
  command->add_flag("--json", o.json, "As JSON");
  addSampleOptions(*command, o.samples);
  command->callback([options, &action] { action = [options] { return runBench(*options); }; });
}

}  // namespace braid
