// SPDX-License-Identifier: Apache-2.0
#include "tools/render/render_report.h"

#include <algorithm>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

nlohmann::json errorOrNull(const std::optional<double>& error) {
  return error ? nlohmann::json(*error) : nlohmann::json(nullptr);
}

// How to look at the path, where `braid replay` can follow what lands in one pixel; or else where it is.
std::string describe(const RunReport::RejectedSample& r, const RenderOptions& o) {
  if (r.integrator != "pt" && r.integrator != "crn" && r.integrator != "bdpt")
    return fmt::format("pass {} of {}, pixel {},{}", r.pass, r.integrator, r.x, r.y);
  return fmt::format("braid replay {} --integrator {} --pass {} --pixel {},{} --size {} --seed {}", o.scene.file,
                     r.integrator, r.pass, r.x, r.y, toString(o.scene.size), o.samples.seed);
}

}  // namespace

RunTimes timesOf(const OpenedScene& opened, const LoopTimes& loop, const WrittenImage& written) {
  const BuildTimes build = opened.reused ? BuildTimes{} : opened.scene->buildTimes();
  RunTimes t;
  t.load = opened.loadSeconds;
  t.prepare = build.prepare;
  t.hierarchy = build.hierarchy;
  t.start = std::max(0.0, loop.began - loop.imageBegan - t.load - t.prepare - t.hierarchy);
  t.render = loop.ended - loop.began - written.secondsOfRun;
  t.combine = written.combineSeconds;
  t.total = processSeconds() - loop.imageBegan;
  t.write = std::max(0.0, t.total - t.beforeRender() - t.render - t.combine);
  return t;
}

nlohmann::json resultRecord(const FinishedRender& render, const RenderOptions& o, const Scene& scene) {
  const RunReport& r = render.run;
  const RunTimes& times = render.times;
  return {{"status", r.reason == StopReason::Cancelled ? "interrupted" : "done"},
          {"reason", toString(r.reason)},
          {"spp", r.spp},
          {"fewestSamples", r.mostSamples > 0 ? r.fewestSamples : r.spp},
          {"mostSamples", r.mostSamples > 0 ? r.mostSamples : r.spp},
          {"placementGain", r.placementGain > 0 ? nlohmann::json(r.placementGain) : nullptr},
          {"estimatedError", errorOrNull(render.written.error)},
          {"exposure", render.written.tone ? nlohmann::json(render.written.tone->exposureStops) : nullptr},
          {"seconds",
           {{"start", times.start},
            {"load", times.load},
            {"prepare", times.prepare},
            {"hierarchy", times.hierarchy},
            {"render", times.render},
            {"combine", times.combine},
            {"write", times.write},
            {"total", times.total}}},
          {"paths", r.paths},
          {"rays", r.rays + r.shadowRays},
          {"rejectedSamples", r.rejected},
          {"warnings", scene.data().warnings},
          {"outputs", o.files()}};
}

void sayResult(const FinishedRender& render, const RenderOptions& o) {
  const auto& [r, written, t] = render;
  for (const std::string& text : written.warnings) fmt::print(stderr, "warning: {}\n", text);
  if (r.rejected > 0) fmt::print(stderr, "warning: {} non-finite or negative samples counted as 0\n", r.rejected);
  if (r.firstRejected) fmt::print(stderr, "one of them: {}\n", describe(*r.firstRejected, o));
  for (const PlanLine& line : r.decisions)
    fmt::print(stderr, "{} {}: {}\n", line.kept ? '+' : '-', line.subject, line.reason);
  if (r.placementGain > 0)
    fmt::print(stderr, "{} to {} samples a pixel, by which {:.2f} times less error is expected\n", r.fewestSamples,
               r.mostSamples, r.placementGain);
  for (const std::string& text : written.timings) fmt::print(stderr, "{}\n", text);
  if (written.tone) fmt::print(stderr, "{}\n", describe(*written.tone));
  std::string outputs;
  for (const std::string& file : o.files()) {
    fmt::print(stderr, "Saved: {}\n", file);
    outputs += (outputs.empty() ? "" : ", ") + file;
  }
  const double perSecond = t.render > 0 ? 1e-6 / t.render : 0;
  fmt::print(stderr,
             "{} spp in {} (start and load {}, render {}, combine {}, write {}; {:.2f} M paths/s, {:.1f} M rays/s), ",
             r.spp, formatHundredths(t.total), formatHundredths(t.beforeRender()), formatHundredths(t.render),
             formatHundredths(t.combine), formatHundredths(t.write), static_cast<double>(r.paths) * perSecond,
             static_cast<double>(r.rays + r.shadowRays) * perSecond);
  fmt::print(stderr, "{}stopped by {}: {}\n",
             written.error ? fmt::format("estimated error {:.3g}, ", *written.error) : "", toString(r.reason), outputs);
}

void sayNews(const std::vector<Publication>& news, const RenderOptions& o, JsonLog& json) {
  for (const Publication& p : news) {
    if (!p.failure.empty()) {
      if (!o.scene.quiet) fmt::print(stderr, "warning: {} (the render goes on)\n", p.failure);
      json.write("warning", {{"text", p.failure}});
    } else if (!p.image.cancelled) {
      nlohmann::json record = {{"spp", p.spp},
                               {"seconds", p.seconds},
                               {"estimatedError", errorOrNull(p.image.error)},
                               {"outputs", o.image.files()}};
      if (!o.image.combine.methods.empty()) record["combined"] = p.combined;
      json.write("published", record);
    }
  }
}

int exitCode(const FinishedRender& render, const RenderOptions& o) {
  const WrittenImage& written = render.written;
  if (render.run.reason == StopReason::Cancelled) return static_cast<int>(ExitCode::Interrupted);
  if (o.error <= 0 || (written.error && *written.error <= o.error)) return 0;
  fmt::print(stderr, "--error {} was not reached: the estimated error is {}: give more --spp or --time\n", o.error,
             written.error ? fmt::format("{:.3g}", *written.error) : "not known");
  return static_cast<int>(ExitCode::TargetNotReached);
}

}  // namespace braid
