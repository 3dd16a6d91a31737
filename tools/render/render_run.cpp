// SPDX-License-Identifier: Apache-2.0
#include "tools/render/render_run.h"

#include <cstdio>
#include <filesystem>

#include <fmt/format.h>

#include "braid/place_samples.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/output_file.h"
#include "tools/render/render_report.h"
#include "tools/render/render_state.h"
#include "tools/images/exr_metadata.h"
#include "tools/options/file_uses.h"
#include "tools/options/output_options.h"
#include "tools/prepare/prepared_render.h"
#include "tools/publish/coarse_output.h"
#include "tools/run/keep_until_exit.h"
#include "tools/run/late_first_pass.h"
#include "tools/run/run_clock.h"

namespace braid {

namespace {

Settings renderSettings(const RenderOptions& o) {
  Settings settings = makeSettings(o.scene, o.samples);
  settings.keep = o.image.buffers();
  settings.transparent = o.transparent;
  settings.goesOn = !o.checkpoint.empty() || o.passes || o.resume;
  if (o.error > 0 && o.samples.spp == 0 && o.samples.seconds == 0) settings.spp = 0;
  if (o.samples.placeSamples && o.passes)
    throw Error(ExitCode::Usage, "--place-samples: a share does not know the sums of the others: leave out --passes");
  if (o.samples.placeSamples) settings.placement = placementFor(o.image.combine.methods);
  if (!o.passes) return settings;
  if (o.samples.spp > 0) throw Error(ExitCode::Usage, "--spp and --passes: --passes alone says how many");
  settings.firstRound = o.passes->begin;
  settings.spp = o.passes->count();
  return settings;
}

// What is to be known before the first pass: light that nothing will find, the plan, and combining that is left out.
void sayPlan(const PreparedRender& render, const Session& session, const RenderOptions& o, JsonLog& json) {
  const Settings& settings = session.plan().settings;
  if (const std::string& missing = session.plan().unreachable; !missing.empty()) {
    if (o.error > 0 && settings.spp == 0 && settings.seconds == 0)
      throw Error(ExitCode::Usage, "--error: would never be reached: " + missing);
    if (!o.scene.quiet) fmt::print(stderr, "warning: {}\n", missing);
    json.write("warning", {{"text", missing}});
  }
  const PlannedRender& planned = render.planned;
  if (o.scene.verbose) fmt::print(stderr, "{}", planned.text());
  if (!planned.note.empty() && !o.scene.quiet && !o.image.files().empty())
    fmt::print(stderr, "note: nothing is combined: {}\n", planned.note);
  json.write("plan", {{"text", planned.text()}, {"hash", hexString(session.plan().hash())}});
}

// Where an image stands until it is finished: out.part.exr for out.exr.
std::string unfinishedName(const std::string& file) {
  if (file.empty() || file == kStandardOutput) return file;
  std::filesystem::path path(file);
  const std::string ending = path.extension().string();
  return path.replace_extension(".part" + ending).string();
}

void putInPlace(const std::string& from, const std::string& to) {
  std::error_code error;
  if (from != to) std::filesystem::rename(from, to, error);
  if (error)
    throw Error(ExitCode::OutputFailed, fmt::format("{}: cannot be renamed to {}: {}", from, to, error.message()));
}

// A run and what its end is told of.
struct Run {
  const PreparedRender& render;
  const RenderOptions& o;
  Surroundings& around;
  const double began;
  const bool oneOfMany;
  const TimeLimit limit{render.planned.plan.settings.seconds, began};
  // Seconds that the plain file takes, where the time is limited.
  const double writing = limit.exists() ? expectedCosts(plan().window, o.image, plan().settings.threads).plain : 0;

  const Plan& plan() const { return render.planned.plan; }

  // As long as it is not finished.
  ImageOutput image() const {
    ImageOutput image = o.image;
    if (oneOfMany)
      for (std::string* file : {&image.file, &image.png}) *file = unfinishedName(*file);
    return image;
  }

  // Lines for people, a record for programs, and the exit code.
  int end(const RunReport& result, const LoopTimes& loop, const WrittenImage& written) const {
    RenderOptions left = o;
    left.image = image();
    if (result.reason != StopReason::Cancelled) {
      putInPlace(left.image.file, o.image.file);
      putInPlace(left.image.png, o.image.png);
      left.image = o.image;
    }
    const FinishedRender finished{result, written, timesOf(render.opened, loop, written)};
    if (!o.scene.quiet) sayResult(finished, left);
    around.json.write("end", resultRecord(finished, left, render.scene()));
    return exitCode(finished, o);
  }

  // The coarse picture becomes the image.
  int endCoarse(const CoarseRender& coarse, double loopBegan) const {
    const LoopTimes loop{loopBegan, processSeconds(), began};
    const Scene& scene = render.scene();
    const WrittenImage written = writeCoarse(coarse, plan(), around.viewer.with(image()),
                                             planAttributes(scene, plan(), scene.accel().isa()), limit);
    around.json.write("warning", {{"text", written.warnings.front()}});
    RunReport result = coarse.report();
    if (result.reason != StopReason::Cancelled) result.reason = StopReason::Time;
    return end(result, loop, written);
  }

  // A picture to fall back on where a pass over all pixels may take longer than --time. States hold whole passes, so a
  // run that keeps one finishes its first.
  std::optional<CoarseRender> coarse(bool resumed) const {
    std::optional<CoarseRender> picture;
    if (!o.image.files().empty() && o.checkpoint.empty() && !o.passes && !resumed &&
        mayBeTooLate(plan().window, plan().settings.threads, limit))
      picture.emplace(
          render.scene(), render.opened.camera, plan(), [this] { return limit.left() - writing; }, &around.interrupted);
    return picture;
  }
};

// The passes, published as they come, and the files at the end.
int renderAndWrite(Session& session, const Run& run, std::optional<CoarseRender>& coarse) {
  const RenderOptions& o = run.o;
  JsonLog& json = run.around.json;
  const bool writesImages = !o.image.files().empty();
  if (writesImages) run.around.modules.checkImages();
  const Settings& settings = session.plan().settings;
  ProgressLine line(o.scene.quiet);
  Publisher publisher({run.around.viewer.with(run.image()), o.checkpoint, o.saveEvery, o.error,
                       settings.spp == 0 && !run.limit.exists(), settings.threads, run.limit},
                      session);
  if (run.limit.exists()) session.setTimeLeft([&] { return publisher.timeLeft(); });
  LateFirstPass late(run.limit, session, o.scene.quiet, coarse.has_value(), run.writing);
  LoopTimes loop{processSeconds(), 0, run.began};
  const RunReport result = session.advance(
      [&](const Progress& p) {
        late.over(p.round, json);
        if (late.dropped()) return false;
        coarse.reset();
        if (writesImages) run.around.modules.checkImages();
        std::vector<Publication> news = publisher.round(p);
        run.around.viewer.addFailure(news);
        sayNews(news, o, json);
        line.update(p);
        json.write("progress", {{"spp", p.round}, {"seconds", p.seconds}, {"secondsLeft", p.secondsLeft}});
        return true;
      },
      &run.around.interrupted, &late.dropped(), &publisher.reached());
  loop.ended = processSeconds();
  line.finish();
  return late.dropped() ? run.endCoarse(*coarse, loop.began) : run.end(result, loop, publisher.finish());
}

}  // namespace

Viewer::Viewer(const RenderOptions& o) : title_(std::filesystem::path(o.scene.file).filename().string()) {
  if (o.tev) tev_.emplace(*o.tev);
}

ImageOutput Viewer::with(ImageOutput image) {
  if (tev_) image.show = [this](const ImageViews& views) { showInTev(*tev_, title_, views); };
  return image;
}

void Viewer::addFailure(std::vector<Publication>& news) {
  if (std::string text = tev_ ? tev_->takeWarning() : ""; !text.empty()) {
    news.emplace_back();
    news.back().failure = std::move(text);
  }
}

void checkOutputs(const RenderOptions& o) {
  if (o.files().empty()) throw Error(ExitCode::Usage, "nothing to write: give -o OUT.exr, --png or --checkpoint");
  if (o.error > 0 && o.image.files().empty())
    throw Error(ExitCode::Usage, "--error: there is no image to estimate it from: give -o OUT.exr");
  FileUses uses;
  uses.scene(o.scene.file, o.scene.environment);
  for (const std::string& name : o.image.combine.names()) uses.method(name);
  if (!isSameFile(resumedFile(o), o.checkpoint)) uses.input("the state of --resume", resumedFile(o));
  uses.output("--output", o.image.file);
  uses.output("--png", o.image.png);
  uses.output("--checkpoint", o.checkpoint);
  uses.output("--log-json", o.logJson);
  uses.check();
  checkImageFiles(o.image);
  if (!o.checkpoint.empty()) prepareOutput(o.checkpoint);
  protectCheckpoint(o);
}

int renderImage(ImageRun& image, Surroundings& around) {
  RenderOptions& o = image.options;
  Settings settings = renderSettings(o);
  std::optional<FilmState> earlier = earlierState(o, settings);
  if (earlier) keepAsBefore(*earlier, settings);
  // The passes of all machines will be combined, of which a share has few.
  const uint64_t samples = settings.spp > 0 ? settings.spp + settings.firstRound : 0;
  PreparedRender render = prepareRender(image.open(), settings, o.image.combine,
                                        {samples, !o.checkpoint.empty() || o.passes, earlier.has_value()});
  if (!o.image.files().empty()) requireRunnable(render.planned.combinePlan, o.image.combine.methods);
  requireWithinLimit(render.planned.memory);
  const Run run{render, o, around, image.began, image.oneOfMany};
  const double began = processSeconds();
  std::optional<CoarseRender> coarse = run.coarse(earlier.has_value());
  int code = 0;
  if (coarse && !coarse->fullRoundFits()) {
    coarse->refine(run.limit.grace());
    code = run.endCoarse(*coarse, began);
  } else {
    std::unique_ptr<Session> session = beginSession(render, o.scene);
    sayPlan(render, *session, o, around.json);
    if (earlier) session->resume(std::move(*earlier), resumedFile(o));
    earlier.reset();
    code = renderAndWrite(*session, run, coarse);
    if (!image.oneOfMany) keepUntilExit(std::move(session));
  }
  if (image.oneOfMany)
    image.scene = std::move(render.opened.scene);
  else
    keepUntilExit(std::move(render.opened.scene));
  return code;
}

}  // namespace braid
