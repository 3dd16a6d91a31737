// SPDX-License-Identifier: Apache-2.0
// `braid preview`: watch a scene converge, in a browser or in tev; noisy, combined and error side by side.
#include <sys/resource.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "braid/place_samples.h"
#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/files/output_file.h"
#include "tools/options/cli.h"
#include "tools/options/file_uses.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/preview/preview_board.h"
#include "tools/preview/preview_feed.h"
#include "tools/preview/preview_server.h"
#include "tools/images/exr_metadata.h"
#include "tools/prepare/open_modules.h"
#include "tools/prepare/prepared_render.h"
#include "tools/publish/publisher.h"
#include "tools/publish/tev_client.h"
#include "tools/run/interrupt.h"
#include "tools/run/progress_line.h"

namespace braid {

namespace {

constexpr int kPort = 8080;           // when nothing is said, and it is free
constexpr double kFarewell = 3;       // seconds for which the end is shown to whoever watches
constexpr double kWatchedWithin = 3;  // seconds since the last question of a page

struct PreviewOptions {
  SceneChoice scene;
  SampleChoice samples;
  ImageOutput image;
  std::optional<TevAddress> tev;
  int port = -1;  // -1: none is asked for
};

Settings previewSettings(const PreviewOptions& o) {
  Settings settings = makeSettings(o.scene, o.samples);
  if (o.samples.spp == 0 && o.samples.seconds == 0) settings.spp = 0;  // until it is stopped
  settings.keep = o.image.buffers();
  if (o.samples.placeSamples) settings.placement = placementFor(o.image.combine.methods);
  return settings;
}

// Whoever watches: pages by way of the board, and tev.
class Audience {
 public:
  Audience(const PreviewOptions& o, std::atomic<bool>& stop)
      : quiet_(o.scene.quiet),
        title_(std::filesystem::path(o.scene.file).filename().string()),
        board_(title_, o.image.files(), o.image.tone) {
    if (o.tev) tev_.emplace(*o.tev);
    if (o.port < 0 && tev_) return;
    serve(o.port, [&stop] { stop = true; });
    std::FILE* to = o.image.file == kStandardOutput || o.image.png == kStandardOutput ? stderr : stdout;
    fmt::print(to, "{}\n", server_->url());
    std::fflush(to);
  }

  PreviewBoard& board() { return board_; }

  void show(uint64_t spp, double seconds, const ImageViews& views) {
    board_.show(spp, seconds, views);
    if (tev_) showInTev(*tev_, title_, views);
  }

  void warn(const std::string& text) {
    board_.warn(text);
    if (!quiet_) fmt::print(stderr, "warning: {} (the render goes on)\n", text);
  }

  void passWarningsOn() {
    if (!tev_) return;
    if (const std::string text = tev_->takeWarning(); !text.empty()) warn(text);
  }

  // Gives pages the time to fetch the last images.
  void sayFarewell(const std::atomic<bool>& interrupted) const {
    const Stopwatch clock;
    while (server_ && server_->watched(kWatchedWithin) && !interrupted && clock.seconds() < kFarewell)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }

 private:
  void serve(int port, const std::function<void()>& stop) {
    if (port < 0) {
      try {
        server_.emplace(board_, kPort, stop);
        return;
      } catch (const Error&) {
        port = 0;
      }
    }
    server_.emplace(board_, port, stop);
  }

  const bool quiet_;
  const std::string title_;
  PreviewBoard board_;
  std::optional<TevClient> tev_;
  std::optional<PreviewServer> server_;
};

void saySaved(const PreviewOptions& o, const RunReport& result, const WrittenImage& written,
              const std::string& reason) {
  if (o.scene.quiet) return;
  for (const std::string& text : written.warnings) fmt::print(stderr, "warning: {}\n", text);
  if (written.tone) fmt::print(stderr, "{}\n", describe(*written.tone));
  for (const std::string& file : o.image.files()) fmt::print(stderr, "Saved: {}\n", file);
  fmt::print(stderr, "{} spp in {}, {}stopped by {}\n", result.spp, formatSeconds(result.seconds),
             written.error ? fmt::format("estimated error {:.3g}, ", *written.error) : "", reason);
}

// The last images, combined from all samples, to the files and to whoever watches. Without files an interrupted
// preview ends at once.
WrittenImage save(const PreviewOptions& o, const Session& session, const RunReport& result, Audience& audience,
                  bool interrupted) {
  if (interrupted && o.image.files().empty()) return {};
  audience.board().setPhase(PreviewPhase::Saving);
  ImageOutput output = o.image;
  output.show = [&](const ImageViews& v) { audience.show(result.spp, result.seconds, v); };
  Estimates estimates = describedEstimates(session, !o.image.noTiming);
  return writeImage(output, estimates, nullptr, o.samples.threads);
}

void checkOutputs(const PreviewOptions& o) {
  FileUses uses;
  uses.scene(o.scene.file, o.scene.environment);
  uses.output("--output", o.image.file);
  uses.output("--png", o.image.png);
  uses.check();
  checkImageFiles(o.image);
}

// The passes, until a limit, the page or a signal ends them.
RunReport showPasses(const PreviewOptions& o, Session& session, Audience& audience, OpeningModules& modules,
                     const std::atomic<bool>& stop, const std::atomic<bool>& interrupted) {
  const bool writesImages = !o.image.files().empty();
  if (writesImages) modules.checkImages();
  const bool knowsErrors = session.plan().unreachable.empty();
  PreviewFeed feed(
      o.image.combine, session, session.plan().settings.threads,
      [&](uint64_t spp, double seconds, ImageViews v) {
        // Light that is missing leaves no trace in the samples: their error is not known.
        if (!knowsErrors) v.noisyError = v.combinedError = nullptr;
        audience.show(spp, seconds, v);
      },
      [&](const std::string& text) { audience.warn(text); });
  ProgressLine line(o.scene.quiet);
  const RunReport result = session.advance(
      [&](const Progress& p) {
        feed.round(p);
        if (writesImages) modules.checkImages();
        audience.board().progress(p);
        audience.passWarningsOn();
        line.update(p);
        return !stop;
      },
      &interrupted);
  line.finish();
  return result;
}

int runPreview(PreviewOptions o) {
  const Settings settings = previewSettings(o);
  checkOutputs(o);
  const std::atomic<bool>& interrupted = installInterruptHandler();
  std::atomic<bool> stop{false};
  Audience audience(o, stop);
  // From here on: the browser that shows the image, and the threads that serve it, go before those that make it, which
  // inherit this.
  setpriority(PRIO_PROCESS, 0, 5);

  OpeningModules modules;
  const PreparedRender render = prepareRender(o.scene, settings, o.image.combine, {settings.spp});
  const PlannedRender& planned = render.planned;
  requireRunnable(planned.combinePlan, o.image.combine.methods);
  if (!planned.note.empty()) audience.warn(fmt::format("nothing is combined: {}", planned.note));
  const std::unique_ptr<Session> session = beginSession(render, o.scene);
  if (o.scene.verbose) fmt::print(stderr, "{}", planned.text());
  const Plan& plan = session->plan();
  audience.board().setPlan(planned.text(), o.image.combine.text(), static_cast<int>(plan.integrators.size()));
  if (!plan.unreachable.empty()) audience.warn(plan.unreachable);
  audience.board().setPhase(PreviewPhase::Rendering);
  const RunReport result = showPasses(o, *session, audience, modules, stop, interrupted);

  const bool cancelled = result.reason == StopReason::Cancelled && !stop;
  const WrittenImage written = save(o, *session, result, audience, cancelled);
  const std::string reason = stop ? "the page" : cancelled ? "a signal" : toString(result.reason);
  saySaved(o, result, written, reason);
  audience.board().end(reason, o.image.files());
  audience.sayFarewell(interrupted);
  return cancelled ? static_cast<int>(ExitCode::Interrupted) : 0;
}

constexpr const char* kPreviewHints =
    "Without --spp and --time it goes on until it is stopped: by the button of the page, or by Ctrl-C.\n"
    "Examples:\n"
    "  braid preview scene.glb                                 (then open the address that it prints)\n"
    "  braid preview scene.glb --http 8080 --size 1280x720 -o out.exr --png out.png\n"
    "  braid preview scene.glb --http 0 --integrator pt,sppm --combine js@sppm --time 5m\n"
    "  braid preview scene.glb --tev 127.0.0.1:14158\n"
    "On another machine: ssh -L 8080:127.0.0.1:8080 HOST, then http://127.0.0.1:8080 here.";

}  // namespace

void addPreview(CLI::App& app, Action& action) {
  auto options = std::make_shared<PreviewOptions>();
  PreviewOptions& o = *options;
  o.scene.size = {640, 360};
  o.samples.integrators = {"auto"};
  combineByDefault(o.image.combine);
  CLI::App* command = app.add_subcommand("preview", "Watch a scene converge, in a browser or in tev");
  command->footer(kPreviewHints);
  addSceneOptions(*command, o.scene);
  addSampleOptions(*command, o.samples);
  addPlacement(*command, o.samples);
  addImageOptions(*command, o.image);
  command
      ->add_option("--http", o.port,
                   fmt::format("Serve the page at this port of 127.0.0.1; 0: any that is free (default: {}, or any if "
                               "that is taken; with --tev none)",
                               kPort))
      ->check(wholeNumber(0, 65535))
      ->type_name("PORT");
  addParsed(*command, "--tev", o.tev, parseTevAddress, "Show the images in tev, which listens there")
      ->type_name("HOST:PORT");
  showFirst(*command, "Viewers", {"--http", "--tev"});
  command->callback([options, command, &action] {
    noteWhoAsked(*command, options->image.combine);
    action = [options] { return runPreview(*options); };
  });
}

}  // namespace braid
