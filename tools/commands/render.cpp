// SPDX-License-Identifier: Apache-2.0
// `braid render`: a glTF scene to a multilayer EXR, to a state that can be resumed, or to one machine's share of it.
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/images/open_images.h"
#include "tools/commands/render_options.h"
#include "tools/commands/render_report.h"
#include "tools/commands/render_state.h"
#include "tools/options/cli.h"
#include "tools/options/file_uses.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/output_options.h"
#include "tools/prepare/prepared_render.h"
#include "tools/publish/coarse_output.h"
#include "tools/images/exr_metadata.h"
#include "tools/publish/publisher.h"
#include "tools/run/interrupt.h"
#include "tools/run/keep_until_exit.h"
#include "tools/run/late_first_pass.h"
#include "tools/run/progress_line.h"
#include "tools/run/run_clock.h"

namespace braid {

namespace {

Settings renderSettings(const RenderOptions& o) {
  Settings settings = makeSettings(o.scene, o.samples);
  settings.keep = o.image.buffers();
  settings.transparent = o.transparent;
  if (o.error > 0 && o.samples.spp == 0 && o.samples.seconds == 0) settings.spp = 0;
  if (!o.passes) return settings;
  if (o.samples.spp > 0) throw Error(ExitCode::Usage, "--spp and --passes: --passes alone says how many");
  settings.firstRound = o.passes->begin;
  settings.spp = o.passes->count();
  return settings;
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

// What goes to the viewer of --tev with each publication, and what it says of it.
class Viewer {
 public:
  explicit Viewer(const RenderOptions& o) : title_(std::filesystem::path(o.scene.file).filename().string()) {
    if (o.tev) tev_.emplace(*o.tev);
  }
  // `image` with the viewer; this must outlive its use.
  ImageOutput with(ImageOutput image) {
    if (tev_) image.show = [this](const ImageViews& views) { showInTev(*tev_, title_, views); };
    return image;
  }
  // What could not be shown, as a publication that failed.
  void addFailure(std::vector<Publication>& news) {
    if (std::string text = tev_ ? tev_->takeWarning() : ""; !text.empty()) {
      news.emplace_back();
      news.back().failure = std::move(text);
    }
  }

 private:
  const std::string title_;
  std::optional<TevClient> tev_;
};

// What a run deals with besides its pixels.
struct Surroundings {
  explicit Surroundings(const RenderOptions& o) : viewer(o), json(o.logJson), interrupted(installInterruptHandler()) {}

  Viewer viewer;
  JsonLog json;
  const std::atomic<bool>& interrupted;
  OpeningImages images;
};

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

// A run and what its end is told of.
struct Run {
  const PreparedRender& render;
  const RenderOptions& o;
  Surroundings& around;
  const TimeLimit limit{render.planned.plan.settings.seconds};
  // Seconds that the plain file takes, where the time is limited.
  const double writing = limit.exists() ? expectedCosts(plan().window, o.image, plan().settings.threads).plain : 0;

  const Plan& plan() const { return render.planned.plan; }

  // Lines for people, a record for programs, and the exit code.
  int end(const RunReport& result, const LoopTimes& loop, const WrittenImage& written) const {
    const FinishedRender finished{result, written, timesOf(render.opened, loop, written)};
    if (!o.scene.quiet) sayResult(finished, o);
    around.json.write("end", resultRecord(finished, o, render.scene()));
    around.json.finish();
    return exitCode(finished, o);
  }

  // The coarse picture becomes the image.
  int endCoarse(const CoarseRender& coarse, double began) const {
    const LoopTimes loop{began, processSeconds()};
    const Scene& scene = render.scene();
    const WrittenImage written = writeCoarse(coarse, plan(), around.viewer.with(o.image),
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
  if (writesImages) run.around.images.check();
  const Settings& settings = session.plan().settings;
  ProgressLine line(o.scene.quiet);
  Publisher publisher({run.around.viewer.with(o.image), o.checkpoint, o.saveEvery, o.error,
                       settings.spp == 0 && !run.limit.exists(), settings.threads, run.limit},
                      session);
  if (run.limit.exists()) session.setTimeLeft([&] { return publisher.timeLeft(); });
  LateFirstPass late(run.limit, session, o.scene.quiet, coarse.has_value(), run.writing);
  LoopTimes loop{processSeconds()};
  const RunReport result = session.advance(
      [&](const Progress& p) {
        late.over(p.round, json);
        if (late.dropped()) return false;
        coarse.reset();
        if (writesImages) run.around.images.check();
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

int runRender(RenderOptions o) {
  Settings settings = renderSettings(o);
  checkOutputs(o);
  Surroundings around(o);
  std::optional<FilmState> earlier = earlierState(o, settings);
  if (earlier) keepAsBefore(*earlier, settings);
  // The passes of all machines will be combined, of which a share has few.
  const uint64_t samples = settings.spp > 0 ? settings.spp + settings.firstRound : 0;
  PreparedRender render = prepareRender(o.scene, settings, o.image.combine,
                                        {samples, !o.checkpoint.empty() || o.passes, earlier.has_value()});
  if (!o.image.files().empty()) requireRunnable(render.planned.combinePlan, o.image.combine.methods);
  requireWithinLimit(render.planned.memory);
  const Run run{render, o, around};
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
    keepUntilExit(std::move(session));
  }
  keepUntilExit(std::move(render.opened.scene));
  return code;
}

// Returns --resume, whose value may be left out.
CLI::Option* addLongRunOptions(CLI::App& command, RenderOptions& o) {
  command.add_option("--checkpoint", o.checkpoint, "Keep all sums in this file, to resume or merge")->type_name("FILE");
  CLI::Option* resume =
      command
          .add_option("--resume", o.resumeFile,
                      "Go on from a checkpoint: the pixels are those of a run that was never interrupted; without FILE "
                      "from that of --checkpoint, if it exists")
          ->expected(0, 1)
          ->type_name("FILE");
  command.add_flag("--overwrite", o.overwrite, "Begin anew although the file of --checkpoint exists");
  addParsed(command, "--save-every", o.saveEvery, parseDuration,
            "Replace the outputs this often, besides after 1, 2, 4, ... samples; 0: only then")
      ->default_str("60")
      ->type_name("DURATION");
  addParsed(command, "--passes", o.passes, parsePasses, "Only these passes: one machine's share, for `braid merge`")
      ->type_name("FIRST:END");
  addParsed(command, "--tev", o.tev, parseTevAddress,
            "Show what is published in tev, an image viewer that listens there")
      ->type_name("HOST:PORT");
  command.add_option("--log-json", o.logJson, "Progress and result as JSON lines, to a file or - for standard output")
      ->type_name("FILE");
  showFirst(command, kLongHelp, {"--checkpoint", "--resume", "--overwrite", "--save-every", "--passes", "--tev"});
  return resume;
}

constexpr const char* kRenderExamples =
    "Examples:\n"
    "  braid render scene.glb -o out.exr --spp 256\n"
    "  braid render scene.glb -o out.png\n"
    "  braid render scene.glb -o out.exr --integrator pt --combine none --aovs all\n"
    "  braid render scene.glb -o out.exr --time 2m --env sky.hdr --png out.png\n"
    "  braid render scene.glb -o out.exr --error 0.001 --time 1h\n"
    "  braid render scene.glb -o out.exr --spp 4096 --checkpoint run.state --resume\n"
    "  braid render scene.glb --passes 256:512 --checkpoint part1.state    (then: braid merge)";

}  // namespace

void addRender(CLI::App& app, Action& action) {
  auto options = std::make_shared<RenderOptions>();
  RenderOptions& o = *options;
  o.samples.integrators = {"auto"};
  combineByDefault(o.image.combine);
  CLI::App* command = app.add_subcommand("render", "Render a scene to an image");
  command->footer(kRenderExamples);
  addSceneOptions(*command, o.scene);
  addSampleOptions(*command, o.samples);
  addImageOptions(*command, o.image);
  command->add_flag("--transparent", o.transparent, "Alpha channel; camera rays that miss add nothing");
  command->add_option("--error", o.error, "Stop at this estimated relative error (relL2 of `compare`)")
      ->check(number(0, 1e9, Ends::LeastExcluded));
  showFirst(*command, kSampleHelp, {"--error"});
  showFirst(*command, kOutputHelp, {"--transparent"});
  const CLI::Option* resume = addLongRunOptions(*command, o);
  command->callback([options, resume, command, &action] {
    options->resume = resume->count() > 0;
    noteWhoAsked(*command, options->image.combine);
    action = [options] { return runRender(*options); };
  });
}

}  // namespace braid
