// SPDX-License-Identifier: Apache-2.0
#include "tools/options/cli.h"

#include <CLI/CLI.hpp>

#include "tools/options/syntax/help.h"
#include "tools/options/memory_limit.h"
#include "tools/options/syntax/option_checks.h"

namespace braid {

void addCommands(CLI::App& app, MainOptions& o, Action& action) {
  app.require_subcommand(0, 1);
  app.add_flag_function(  // main() prints
      "--list", [](int64_t) {}, "Print every registered integrator, denoiser, combiner and metric");
  app.add_option("--documents", o.documents, "Write man pages and completions of shells to a folder")
      ->type_name("FOLDER")
      ->group("");
  addParsed(app, "--memory-limit", o.memoryLimit, parseBytes,
            "Memory that may be taken, such as 4G; beyond it: exit code 5")
      ->type_name("SIZE");
  app.fallthrough();
  useShortHelp(app);
  app.footer("The options of a command: braid COMMAND -h");
  addRender(app, action);
  addPreview(app, action);
  addPlan(app, action);
  addInfo(app, action);
  addCompare(app, action);
  addCombine(app, action);
  addMerge(app, action);
  addSweep(app, action);
  addReplay(app, action);
  addBench(app, action);
}

}  // namespace braid
