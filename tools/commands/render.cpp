// SPDX-License-Identifier: Apache-2.0
// `braid render`: a glTF scene to a multilayer EXR, to a state that can be resumed, or to one machine's share of it.
#include <CLI/CLI.hpp>

#include "tools/render/render_run.h"
#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"

namespace braid {

namespace {

int runRender(const RenderOptions& options) {
  checkFrames(options.frames, options.scene.frameTime >= 0);
  if (options.frames.any()) return renderFrames(options);
  checkOutputs(options);
  Surroundings around(options);
  ImageRun run{options, [&options] { return openScene(options.scene); }};
  const int code = renderImage(run, around);
  around.json.finish();
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
    "  braid render scene.glb -o out_####.exr --frames 0:24 --fps 24 --checkpoint out_####.state\n"
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
  addFrameRangeOptions(*command, o.frames);
  addSampleOptions(*command, o.samples);
  addPlacement(*command, o.samples);
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
