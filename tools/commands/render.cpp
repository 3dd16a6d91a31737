// SPDX-License-Identifier: Apache-2.0
// `braid render`: a glTF scene to a multilayer EXR, to a state that can be resumed, or to one machine's share of it.
#include <filesystem>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/state_file.h"
#include "renderer/images/open_images.h"
#include "tools/options/cli.h"
#include "tools/options/combining.h"
#include "tools/options/file_uses.h"
#include "tools/publish/exr_metadata.h"
#include "tools/run/interrupt.h"
#include "tools/run/keep_until_exit.h"
#include "tools/run/late_first_pass.h"
#include "tools/options/option_checks.h"
#include "tools/options/output_options.h"
#include "tools/run/progress_line.h"
#include "tools/publish/publisher.h"
#include "tools/publish/render_plan.h"
#include "tools/run/run_clock.h"
#include "tools/publish/scene_identity.h"
#include "tools/publish/tev_client.h"
#include "tools/publish/coarse_output.h"
#include "version.h"

namespace braid {

namespace {

struct RenderOptions {
  SceneChoice scene;
  SampleChoice samples;
  ImageOutput image;
  std::string logJson, checkpoint, resumeFile, passes, saveEvery = "60", tev;
  bool resume = false, overwrite = false, transparent = false;
  double error = 0;

  // What the run leaves behind.
  std::vector<std::string> files() const {
    std::vector<std::string> list = image.files();
    if (!checkpoint.empty()) list.push_back(checkpoint);
    return list;
  }
};

Settings renderSettings(const RenderOptions& o) {
  Settings settings = makeSettings(o.scene, o.samples);
  settings.keep = o.image.buffers();
  settings.transparent = o.transparent;
  if (o.error > 0 && o.samples.spp == 0 && o.samples.time.empty()) settings.spp = 0;
  if (o.passes.empty()) return settings;
  if (o.samples.spp > 0) throw Error(ExitCode::Usage, "--spp and --passes: --passes alone says how many");
  const PassInterval passes = parsePasses(o.passes);
  settings.firstRound = passes.begin;
  settings.spp = passes.count();
  return settings;
}

// The file of the state to go on from; empty: there is none.
std::string resumedFile(const RenderOptions& o) {
  if (!o.resume) return "";
  return o.resumeFile.empty() ? o.checkpoint : o.resumeFile;
}

// Hours of rendering are not replaced because an option was forgotten.
void protectCheckpoint(const RenderOptions& o) {
  std::error_code ignored;
  if (o.overwrite || o.checkpoint.empty() || !std::filesystem::is_regular_file(o.checkpoint, ignored)) return;
  if (o.resume && isSameFile(resumedFile(o), o.checkpoint)) return;
  std::string held = "is there already, and is no state that this braid can read";
  try {
    const FilmState state = readStateHeader(o.checkpoint);
    uint64_t samples = 0;
    for (const PassInterval& i : state.estimates.front().passes) samples += i.count();
    held = fmt::format("holds {} samples already", samples);
  } catch (const Error&) {
  }
  throw Error(ExitCode::Usage,
              fmt::format("--checkpoint {}: {}: give --resume to go on from it, or --overwrite to begin anew",
                          o.checkpoint, held));
}

// The state to go on from, if there is one.
std::optional<FilmState> earlierState(const RenderOptions& o, const Settings& settings) {
  if (!o.resume) return std::nullopt;
  const std::string file = resumedFile(o);
  if (file.empty()) throw Error(ExitCode::Usage, "--resume: name a file, here or with --checkpoint");
  // A job that is started again after a crash has the same command line as at first, when there was nothing to resume.
  if (o.resumeFile.empty() && !std::filesystem::exists(file)) return std::nullopt;
  FilmState state = readStateFile(file);
  for (const EstimateState& e : state.estimates) {
    const auto perRound = static_cast<uint64_t>(e.passesPerRound);
    const uint64_t begin = settings.firstRound * perRound, end = begin + settings.spp * perRound;
    if (!o.passes.empty() && !e.passes.empty() && (e.firstPass() < begin || e.endPass() > end))
      throw Error(
          ExitCode::BadInput,
          fmt::format("{}: cannot be resumed: it holds the passes {}:{} of {}, which are not all of {}:{}: name "
                      "the --passes that it was begun with",
                      file, e.firstPass(), e.endPass(), e.name, begin, end));
  }
  return state;
}

// What an earlier run kept is kept on, whether or not this one's outputs need it.
void keepAsBefore(const FilmState& state, Settings& settings) {
  KeptBuffers& keep = settings.keep;
  keep.quarters |= state.buckets == 4;
  keep.features |= state.features.has_value();
  for (const StateOption& option : state.identity.options)
    keep.history |= option == StateOption{"keeping history", "on"};
  for (const EstimateState& e : state.estimates) keep.directIndirect |= e.parts.has_value();
  keep.stops = stopsOf(state.identity);
}

nlohmann::json errorOrNull(const std::optional<double>& error) {
  return error ? nlohmann::json(*error) : nlohmann::json(nullptr);
}

// `began`, `ended`: of the pass loop, by the clock of the process. What is not the loop's or combining is writing.
RunTimes timesOf(const LoadTimes& load, const BuildTimes& build, double began, double ended,
                 const WrittenImage& written) {
  RunTimes t;
  t.load = load.load;
  t.prepare = build.prepare;
  t.hierarchy = build.hierarchy;
  t.start = std::max(0.0, began - t.load - t.prepare - t.hierarchy);
  t.render = ended - began - written.secondsOfRun;
  t.combine = written.combineSeconds;
  t.total = processSeconds();
  t.write = std::max(0.0, t.total - t.beforeRender() - t.render - t.combine);
  return t;
}

nlohmann::json resultRecord(const RunReport& r, const RenderOptions& o, const RunTimes& times, const Scene& scene,
                            const WrittenImage& written) {
  return {{"status", r.reason == StopReason::Cancelled ? "interrupted" : "done"},
          {"reason", toString(r.reason)},
          {"spp", r.spp},
          {"estimatedError", errorOrNull(written.error)},
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

// How to look at the path, where `braid replay` can follow what lands in one pixel; or else where it is.
std::string describe(const RunReport::RejectedSample& r, const RenderOptions& o) {
  if (r.integrator != "pt" && r.integrator != "crn" && r.integrator != "bdpt")
    return fmt::format("pass {} of {}, pixel {},{}", r.pass, r.integrator, r.x, r.y);
  return fmt::format("braid replay {} --integrator {} --pass {} --pixel {},{} --size {} --seed {}", o.scene.file,
                     r.integrator, r.pass, r.x, r.y, o.scene.size, o.samples.seed);
}

void tellResult(const RunReport& r, const RenderOptions& o, const RunTimes& t, const WrittenImage& written) {
  for (const std::string& text : written.warnings) fmt::print(stderr, "warning: {}\n", text);
  if (r.rejected > 0) fmt::print(stderr, "warning: {} non-finite or negative samples counted as 0\n", r.rejected);
  if (r.firstRejected) fmt::print(stderr, "one of them: {}\n", describe(*r.firstRejected, o));
  for (const std::string& text : written.timings) fmt::print(stderr, "{}\n", text);
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

void tellNews(const std::vector<Publication>& news, const RenderOptions& o, JsonLog& json) {
  for (const Publication& p : news) {
    if (!p.failure.empty()) {
      if (!o.scene.quiet) fmt::print(stderr, "warning: {} (the render goes on)\n", p.failure);
      json.write("warning", {{"text", p.failure}});
    } else if (!p.image.cancelled) {
      nlohmann::json record = {{"spp", p.spp},
                               {"seconds", p.seconds},
                               {"estimatedError", errorOrNull(p.image.error)},
                               {"outputs", o.image.files()}};
      if (!o.image.combine.wanted().empty()) record["combined"] = p.combined;
      json.write("published", record);
    }
  }
}

void checkOutputs(const RenderOptions& o) {
  if (o.files().empty()) throw Error(ExitCode::Usage, "nothing to write: give -o OUT.exr, --png or --checkpoint");
  if (o.error > 0 && o.image.files().empty())
    throw Error(ExitCode::Usage, "--error: there is no image to estimate it from: give -o OUT.exr");
  FileUses uses;
  uses.scene(o.scene.file, o.scene.environment);
  for (const std::string* methods :
       {&o.image.combine.combine, &o.image.combine.denoisers, &o.image.combine.biased, &o.image.combine.bases})
    uses.methods(*methods);
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
    if (!o.tev.empty()) tev_.emplace(o.tev);
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

// What the run comes to: interrupted, short of its target, or neither.
int exitCode(const RunReport& result, const RenderOptions& o, const WrittenImage& written) {
  if (result.reason == StopReason::Cancelled) return static_cast<int>(ExitCode::Interrupted);
  if (o.error <= 0 || (written.error && *written.error <= o.error)) return 0;
  fmt::print(stderr, "--error {} was not reached: the estimated error is {}: give more --spp or --time\n", o.error,
             written.error ? fmt::format("{:.3g}", *written.error) : "not known");
  return static_cast<int>(ExitCode::TargetNotReached);
}

// What the user is told at the end of a run, whichever picture came of it.
struct Ending {
  const RenderOptions& o;
  const Scene& scene;
  const LoadTimes& load;
  JsonLog& json;

  // `began`, `ended`: of the pass loop. Returns the exit code.
  int tell(const RunReport& result, double began, double ended, const WrittenImage& written) const {
    const RunTimes parts = timesOf(load, scene.buildTimes(), began, ended, written);
    if (!o.scene.quiet) tellResult(result, o, parts, written);
    json.write("end", resultRecord(result, o, parts, scene, written));
    json.finish();
    return exitCode(result, o, written);
  }

  int coarse(const CoarseRender& render, const Plan& plan, const ImageOutput& output, double began) const {
    const double ended = processSeconds();
    const TimeLimit limit(plan.settings.seconds);
    const WrittenImage written =
        writeCoarse(render, plan, output, planAttributes(scene, plan, scene.accel().isa()), limit);
    json.write("warning", {{"text", written.warnings.front()}});
    RunReport result = render.report();
    if (result.reason != StopReason::Cancelled) result.reason = StopReason::Time;
    return tell(result, began, ended, written);
  }
};

int runRender(RenderOptions o) {
  Settings settings = renderSettings(o);
  checkOutputs(o);
  Viewer viewer(o);
  const double saveEvery = parseDuration(o.saveEvery);
  JsonLog json(o.logJson);
  const std::atomic<bool>& interrupted = installInterruptHandler();
  OpeningImages images;
  std::optional<FilmState> earlier = earlierState(o, settings);
  if (earlier) keepAsBefore(*earlier, settings);

  LoadTimes times;
  SceneData data = loadScene(o.scene, &times);
  const CameraData camera = chooseCamera(data, o.scene);
  std::unique_ptr<Scene> scene = buildScene(std::move(data), o.scene, camera);
  const auto integrators = makeIntegrators();
  // The passes of all machines will be combined, of which a share has few.
  const uint64_t samples = settings.spp > 0 ? settings.spp + settings.firstRound : 0;
  RenderPlan plan = planRender(*scene, camera, settings, pointersTo(integrators), o.image.combine,
                               {samples, !o.checkpoint.empty() || !o.passes.empty(), earlier.has_value()});
  if (!o.image.files().empty()) requireRunnable(plan.combinePlan, o.image.combine.wanted());
  requireWithinLimit(plan.memory);
  const TimeLimit limit(settings.seconds);
  const double writing = limit.exists() ? expectedCosts(plan.plan.window, o.image, settings.threads).plain : 0;
  // States hold whole passes, so a run that keeps one finishes its first.
  const double measured = processSeconds();
  std::optional<CoarseRender> coarse;
  if (!o.image.files().empty() && o.checkpoint.empty() && o.passes.empty() && !earlier &&
      mayBeTooLate(plan.plan.window, settings.threads, limit))
    coarse.emplace(
        *scene, camera, plan.plan, [&] { return limit.left() - writing; }, &interrupted);
  const Ending ending{o, *scene, times, json};
  if (coarse && !coarse->fullRoundFits()) {
    coarse->refine(limit.grace());
    const int code = ending.coarse(*coarse, plan.plan, viewer.with(o.image), measured);
    keepUntilExit(std::move(scene));
    return code;
  }
  auto ownedSession = std::make_unique<Session>(*scene, plan.plan);
  Session& session = *ownedSession;
  session.identify(BRAID_VERSION, BRAID_BUILD_FLAGS, sceneIdentity(o.scene, scene->data()),
                   planAttributes(*scene, session.plan(), scene->accel().isa()));
  if (const std::string& missing = session.plan().unreachable; !missing.empty()) {
    if (o.error > 0 && settings.spp == 0 && settings.seconds == 0)
      throw Error(ExitCode::Usage, "--error: would never be reached: " + missing);
    if (!o.scene.quiet) fmt::print(stderr, "warning: {}\n", missing);
    json.write("warning", {{"text", missing}});
  }
  if (o.scene.verbose) fmt::print(stderr, "{}", plan.text());
  if (!plan.note.empty() && !o.scene.quiet && !o.image.files().empty())
    fmt::print(stderr, "note: nothing is combined: {}\n", plan.note);
  json.write("plan", {{"text", plan.text()}, {"hash", hexString(session.plan().hash())}});
  if (earlier) session.resume(std::move(*earlier), resumedFile(o));
  earlier.reset();

  const bool writesImages = !o.image.files().empty();
  if (writesImages) images.check();
  ProgressLine line(o.scene.quiet);
  Publisher publisher({viewer.with(o.image), o.checkpoint, saveEvery, o.error, settings.spp == 0 && !limit.exists(),
                       settings.threads, limit},
                      session);
  if (limit.exists()) session.setTimeLeft([&] { return publisher.timeLeft(); });
  LateFirstPass late(limit, session, o.scene.quiet, coarse.has_value(), writing);
  const double began = processSeconds();
  const RunReport result = session.advance(
      [&](const Progress& p) {
        late.over(p.round, json);
        if (late.dropped()) return false;
        coarse.reset();
        if (writesImages) images.check();
        std::vector<Publication> news = publisher.round(p);
        viewer.addFailure(news);
        tellNews(news, o, json);
        line.update(p);
        json.write("progress", {{"spp", p.round}, {"seconds", p.seconds}, {"secondsLeft", p.secondsLeft}});
        return true;
      },
      &interrupted, &late.dropped(), &publisher.reached());
  const double ended = processSeconds();
  line.finish();
  const int code = late.dropped() ? ending.coarse(*coarse, session.plan(), viewer.with(o.image), began)
                                  : ending.tell(result, began, ended, publisher.finish());
  keepUntilExit(std::move(ownedSession));
  keepUntilExit(std::move(scene));
  return code;
}

}  // namespace

void addRender(CLI::App& app, Action& action) {
  auto options = std::make_shared<RenderOptions>();
  RenderOptions& o = *options;
  o.samples.integrators = "auto";
  combineByDefault(o.image.combine);
  CLI::App* command = app.add_subcommand("render", "Render a scene to an image");
  command->footer(
      "Examples:\n"
      "  braid render scene.glb -o out.exr --spp 256\n"
      "  braid render scene.glb -o out.png\n"
      "  braid render scene.glb -o out.exr --integrator pt --combine none --aovs all\n"
      "  braid render scene.glb -o out.exr --time 2m --env sky.hdr --png out.png\n"
      "  braid render scene.glb -o out.exr --error 0.001 --time 1h\n"
      "  braid render scene.glb -o out.exr --spp 4096 --checkpoint run.state --resume\n"
      "  braid render scene.glb -o out.exr --spp 4096 --tev 127.0.0.1:14158\n"
      "  braid render scene.glb --passes 256:512 --checkpoint part1.state    (then: braid merge)");
  addSceneOptions(*command, o.scene);
  addSampleOptions(*command, o.samples);
  addImageOptions(*command, o.image);
  command->add_flag("--transparent", o.transparent, "Alpha channel; camera rays that miss add nothing");
  command
      ->add_option("--error", o.error,
                   "Stop when the estimated relative error of the image (relL2 of `compare`) is at most this")
      ->check(number(0, 1e9, Ends::LeastExcluded));
  command->add_option("--checkpoint", o.checkpoint, "Keep all sums in this file, to resume or merge")
      ->type_name("FILE");
  CLI::Option* resume =
      command
          ->add_option(
              "--resume", o.resumeFile,
              "Go on from a checkpoint: the pixels are those of a run that was never interrupted; without FILE "
              "from that of --checkpoint, if it exists")
          ->expected(0, 1)
          ->type_name("FILE");
  command->add_flag("--overwrite", o.overwrite, "Begin anew although the file of --checkpoint exists");
  command
      ->add_option("--save-every", o.saveEvery,
                   "While rendering, replace the outputs this often, besides after 1, 2, 4, ... samples; 0: only then")
      ->capture_default_str()
      ->check(duration(true))
      ->type_name("DURATION");
  command
      ->add_option("--passes", o.passes,
                   "Only these passes of every integrator: one machine's share, for `braid merge`")
      ->check(readBy(parsePasses))
      ->type_name("FIRST:END");
  command->add_option("--tev", o.tev, "Show what is published in tev, an image viewer that listens there")
      ->check(readBy(parseTevAddress))
      ->type_name("HOST:PORT");
  command->add_option("--log-json", o.logJson, "Progress and result as JSON lines, to a file or - for standard output")
      ->type_name("FILE");
  command->callback([options, resume, command, &action] {
    options->resume = resume->count() > 0;
    noteWhoAsked(*command, options->image.combine);
    action = [options] { return runRender(*options); };
  });
}

}  // namespace braid
