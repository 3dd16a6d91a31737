// SPDX-License-Identifier: Apache-2.0
// `braid render`: a glTF scene to a multilayer EXR.
#include <fmt/format.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/exr.h"
#include "tools/cli.h"
#include "tools/combining.h"
#include "tools/header.h"
#include "tools/interrupt.h"
#include "tools/output_options.h"
#include "tools/progress_line.h"

namespace braid {

namespace {

struct RenderOptions {
  SceneChoice scene;
  SampleChoice samples;
  std::string output, png, aovs = "all", logJson, layerPrefix;
  double exposure = 0;
  bool quarters = false, history = false, floatHeadline = false, transparent = false, noTiming = false;
  CombineChoice combine;
};

nlohmann::json resultRecord(const RenderResult& r, const RenderOptions& o, double loadSeconds, const Scene& scene,
                            double combineSeconds, double writeSeconds) {
  nlohmann::json outputs = nlohmann::json::array({o.output});
  if (!o.png.empty()) outputs.push_back(o.png);
  return {{"status", r.reason == StopReason::Cancelled ? "interrupted" : "done"},
          {"reason", toString(r.reason)},
          {"spp", r.estimates->estimates.front().passes},
          {"seconds",
           {{"load", loadSeconds},
            {"prepare", scene.buildTimes().prepare},
            {"hierarchy", scene.buildTimes().hierarchy},
            {"render", r.seconds},
            {"combine", combineSeconds},
            {"write", writeSeconds}}},
          {"paths", r.paths},
          {"rays", r.rays + r.shadowRays},
          {"rejectedSamples", r.rejected},
          {"outputs", outputs}};
}

int runRender(const RenderOptions& o) {
  const AovSet aovs = parseAovs(o.aovs);
  Settings settings = makeSettings(o.scene, o.samples);
  settings.features = aovs != AovSet::None;
  settings.quarters = o.quarters;
  settings.history = o.history;
  settings.transparent = o.transparent;
  checkWritable(o.output);
  if (!o.png.empty()) checkWritable(o.png);
  JsonLog json(o.logJson);
  const std::atomic<bool>& interrupted = installInterruptHandler();

  LoadTimes times;
  SceneData data = loadScene(o.scene, &times);
  const CameraData camera = chooseCamera(data, o.scene);
  const std::unique_ptr<Scene> scene = buildScene(std::move(data), o.scene);
  const auto integrators = makeIntegrators();
  const std::vector<std::string> wanted = o.combine.wanted();
  const Recipe recipe = planCombining(*scene, camera, settings, pointersTo(integrators), o.combine);
  requireRunnable(recipe, wanted);
  Session session(*scene, makePlan(*scene, camera, settings, pointersTo(integrators)));
  const std::string planText = session.plan().text() + recipeText(recipe);
  if (o.scene.verbose) fmt::print(stderr, "{}", planText);
  json.write("plan", {{"text", planText}, {"hash", hexString(session.plan().hash())}});

  ProgressLine line(o.scene.quiet);
  RenderResult result = session.run(
      [&](const Progress& p) {
        line.update(p);
        json.write("progress", {{"spp", p.round}, {"seconds", p.seconds}, {"secondsLeft", p.secondsLeft}});
        return true;
      },
      &interrupted);
  line.finish();

  Estimates estimates = *result.estimates;
  estimates.attributes = headerAttributes(*scene, session, result, scene->accel().isa(), !o.noTiming);
  const auto combineStart = std::chrono::steady_clock::now();
  const PipelineResult combined = runCombining(estimates, o.combine, o.combine.options(), settings.threads);
  const double combineSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - combineStart).count();
  const CombinedLayers layers(combined, wanted, o.combine.weights, !o.noTiming, estimates);
  if (layers.headline()) result.image = *layers.headline();
  ExrOptions exr;
  exr.layers = layers.layers();
  exr.history = o.history;
  exr.aovs = aovs;
  exr.quarters = o.quarters;
  exr.floatHeadline = o.floatHeadline;
  exr.layerPrefix = o.layerPrefix;
  const auto writeStart = std::chrono::steady_clock::now();
  const WriteReport report = writeExr(o.output, estimates, result.image, result.alpha ? &*result.alpha : nullptr, exr);
  if (!o.png.empty()) writePng(o.png, result.image, static_cast<float>(o.exposure));
  const double writeSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - writeStart).count();

  if (!o.scene.quiet) {
    for (const std::string& text : combineWarnings(combined)) fmt::print(stderr, "warning: {}\n", text);
    if (report.clampedToHalf > 0)
      fmt::print(stderr, "warning: {}: {} headline values above 65504 were clamped to fit half floats: use --float\n",
                 o.output, report.clampedToHalf);
    if (result.rejected > 0)
      fmt::print(stderr, "warning: {} non-finite or negative samples counted as 0\n", result.rejected);
    if (result.firstRejected)
      fmt::print(stderr, "one of them: braid replay {} --integrator {} --pass {} --pixel {},{} --size {} --seed {}\n",
                 o.scene.file, result.firstRejected->integrator, result.firstRejected->pass, result.firstRejected->x,
                 result.firstRejected->y, o.scene.size, o.samples.seed);
    fmt::print(stderr, "{} spp in {} ({:.2f} M paths/s, {:.1f} M rays/s), stopped by {}\n",
               result.estimates->estimates.front().passes, formatSeconds(result.seconds),
               static_cast<double>(result.paths) / result.seconds * 1e-6,
               static_cast<double>(result.rays + result.shadowRays) / result.seconds * 1e-6, toString(result.reason));
    for (const PipelineOutput& out : combined.outputs)
      if (out.ran())
        fmt::print(stderr, "{} in {}, its inputs in {}\n", out.step.name, formatSeconds(out.seconds),
                   formatSeconds(out.inputSeconds));
    fmt::print(stderr, "Saved: {}\n", o.output);
    if (!o.png.empty()) fmt::print(stderr, "Saved: {}\n", o.png);
  }
  json.write("end", resultRecord(result, o, times.load, *scene, combineSeconds, writeSeconds));
  return result.reason == StopReason::Cancelled ? static_cast<int>(ExitCode::Interrupted) : 0;
}

}  // namespace

void addRender(CLI::App& app, Action& action) {
  auto options = std::make_shared<RenderOptions>();
  RenderOptions& o = *options;
  CLI::App* command = app.add_subcommand("render", "Render a scene to an EXR image");
  command->footer(
      "Examples:\n  braid render scene.glb -o out.exr --spp 256\n  braid render scene.glb -o out.exr --time 2m --env "
      "sky.hdr --png out.png");
  addSceneOptions(*command, o.scene);
  addSampleOptions(*command, o.samples);
  command
      ->add_option("--combine", o.combine.combine,
                   "none, or denoisers and combiners separated by commas (--list); the last one is the image R G B")
      ->capture_default_str();
  addCombineOptions(*command, o.combine);
  command->add_option("-o,--output", o.output, "EXR file to write")->required();
  command->add_option("--png", o.png, "Also write a tone-mapped PNG");
  command->add_option("--exposure", o.exposure, "Exposure of the PNG in stops")->capture_default_str();
  command->add_option("--aovs", o.aovs, "Layers besides the image: none, features or all")->capture_default_str();
  command->add_flag("--quarters", o.quarters, "Also write the four quarter buffers");
  command->add_flag("--history", o.history, "Also write the variances after 1, 2, 4, ... samples, for combining later");
  command->add_flag("--float", o.floatHeadline, "R G B as 32-bit floats");
  command->add_flag("--transparent", o.transparent, "Alpha channel; camera rays that miss add nothing");
  command->add_option("--layer-prefix", o.layerPrefix, "Put before every layer's name, e.g. ViewLayer");
  command->add_flag("--reproducible", o.noTiming, "No run times in the header: identical runs give identical files");
  command->add_option("--log-json", o.logJson, "Progress and result as JSON lines, to a file or - for standard output");
  command->callback([options, &action] { action = [options] { return runRender(*options); }; });
}

}  // namespace braid
