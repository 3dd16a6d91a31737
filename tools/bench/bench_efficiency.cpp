// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/bench_efficiency.h"

#include <algorithm>
#include <ctime>
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "tools/metrics/metrics.h"
#include "tools/prepare/planned_render.h"
#include "tools/sweep/sweep_reference.h"
#include "tools/sweep/table/sweep_error.h"

namespace braid {

namespace {

struct Outcome {
  double error = 0, flip = 0, processor = 0, seconds = 0;
  double product() const { return error * processor; }
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

template <class Part>
double medianOf(const std::vector<Outcome>& outcomes, const Part& part) {
  std::vector<double> values;
  for (const Outcome& o : outcomes) values.push_back(part(o));
  return median(std::move(values));
}

SweepReference referenceOf(const Scene& scene, const CameraData& camera, const EfficiencyBench& bench) {
  SampleChoice samples;
  samples.integrators = {bench.referenceIntegrator};
  samples.spp = bench.referenceSpp;
  samples.maxDepth = bench.variants[0].samples.maxDepth;
  const Settings settings = makeSettings(bench.view, samples);
  const ReferenceFrame frame = referenceFrame(scene, camera, settings);
  if (auto kept = keptReference(bench.references, frame, bench.referenceIntegrator, bench.referenceSpp)) return *kept;
  std::error_code failed;
  std::filesystem::create_directories(bench.references, failed);
  if (failed)
    throw Error(ExitCode::Usage,
                fmt::format("{}: cannot be made ({}); give --references a folder", bench.references, failed.message()));
  const auto integrators = makeIntegrators();
  return *renderReference(bench.references, {scene, camera, settings, pointersTo(integrators)}, {}, nullptr);
}

Outcome render(const Scene& scene, const CameraData& camera, const SceneChoice& view, RenderVariant variant,
               const ReferenceImage& reference) {
  Outcome outcome;
  const Stopwatch clock;
  const std::clock_t begin = std::clock();
  const auto integrators = makeIntegrators();
  const Settings settings = makeSettings(view, variant.samples);
  const PlannedRender planned =
      planRender(scene, camera, settings, pointersTo(integrators), variant.combine, {settings.spp});
  const RenderResult result = Session(scene, planned.plan).run();
  const PipelineResult combined = runCombining(*result.estimates, variant.combine, variant.combine.options(), 0);
  outcome.processor = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  outcome.seconds = clock.seconds();
  requireRunnable(planned.combinePlan, variant.combine.methods);
  Estimates described = *result.estimates;
  const CombinedLayers layers(combined, variant.combine.methods, false, false, described);
  const Rgb<float>& image = layers.headline() ? *layers.headline() : result.image;
  outcome.error = relL2Unbiased(image, reference);
  outcome.flip = metric("FLIP", image, reference.mean);
  return outcome;
}

}  // namespace

RenderVariant parseVariant(const std::string& text, const SampleChoice& base) {
  RenderVariant variant;
  variant.text = text;
  variant.samples = base;
  CLI::App options;
  options.allow_windows_style_options(false);
  addSampleOptions(options, variant.samples);
  options.add_option_function<std::string>(
      "--combine", [&](const std::string& methods) { variant.combine.methods = parseMethods(methods); });
  addCombineOptions(options, variant.combine);
  try {
    options.parse(text, false);
  } catch (const CLI::Error& error) {
    throw Error(ExitCode::Usage, fmt::format("--efficiency \"{}\": {}", text, error.what()));
  }
  return variant;
}

nlohmann::json benchEfficiency(const Scene& scene, const CameraData& camera, const EfficiencyBench& bench) {
  const ReferenceImage reference = referenceOf(scene, camera, bench).image;
  std::vector<std::vector<Outcome>> outcomes(bench.variants.size());
  for (int k = 0; k < bench.repeats; ++k)
    for (size_t v = 0; v < bench.variants.size(); ++v) {
      RenderVariant variant = bench.variants[v];
      variant.samples.seed += static_cast<uint64_t>(k);
      outcomes[v].push_back(render(scene, camera, bench.view, std::move(variant), reference));
    }
  nlohmann::json list = nlohmann::json::array();
  for (size_t v = 0; v < bench.variants.size(); ++v) {
    std::vector<double> ratios;
    for (size_t k = 0; k < outcomes[v].size(); ++k)
      ratios.push_back(outcomes[v][k].product() / outcomes[0][k].product());
    list.push_back({{"variant", bench.variants[v].text},
                    {"relL2", medianOf(outcomes[v], [](const Outcome& o) { return o.error; })},
                    {"hdrFlip", medianOf(outcomes[v], [](const Outcome& o) { return o.flip; })},
                    {"processorSeconds", medianOf(outcomes[v], [](const Outcome& o) { return o.processor; })},
                    {"seconds", medianOf(outcomes[v], [](const Outcome& o) { return o.seconds; })},
                    {"ratio", median(ratios)}});
  }
  return list;
}

}  // namespace braid
