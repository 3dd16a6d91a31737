// SPDX-License-Identifier: Apache-2.0
// The braid command line: one subcommand a file; errors end here as one line and an exit code.
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <new>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/commands/lists.h"
#include "tools/manual/documents.h"
#include "tools/options/cli.h"
#include "tools/options/syntax/help.h"
#include "tools/options/memory_limit.h"
#include "tools/options/syntax/old_spellings.h"
#include "tools/run/standard_streams.h"
#include "version.h"

namespace {

int run(int argc, char** argv) {
  using namespace braid;
  CLI::App app{"braid: renders glTF scenes to converged OpenEXR images on the CPU", argc > 0 ? argv[0] : "braid"};
  app.set_version_flag("--version", std::string("braid ") + BRAID_VERSION + " (" + BRAID_BUILD_FLAGS + ")");
  app.set_help_flag("-h,--help", "Help; -h METHOD: of a denoiser or combiner");
  MainOptions options;
  Action action;
  addCommands(app, options, action);

  try {
    std::vector<std::string> arguments = presentSpellings(argc, argv);
    arguments.erase(arguments.begin());
    if (const std::optional<HelpRequest> help = findHelp(app, arguments)) {
      fmt::print("{}", helpText(app, *help));
      return 0;
    }
    // Beside any command, without the scene or output that it asks for.
    if (std::find(arguments.begin(), arguments.end(), "--list") != arguments.end()) return printLists();
    std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
    app.parse(std::move(arguments));
    if (!options.documents.empty()) {
      writeDocuments(app, options.documents);
      return 0;
    }
    if (!action) {
      fmt::print("{}", app.help());
      return static_cast<int>(ExitCode::Usage);
    }
    if (options.memoryLimit > 0) limitMemory(options.memoryLimit);
    return action();
  } catch (const CLI::ValidationError& e) {
    fmt::print(stderr, "{}\n", printable(e.what()));
    return static_cast<int>(ExitCode::Usage);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(ExitCode::Usage);
  } catch (const Error& e) {
    fmt::print(stderr, "{}\n", e.what());
    return static_cast<int>(e.code());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "out of memory: lower --size or give the process more, by --memory-limit if there is one\n");
    return static_cast<int>(ExitCode::OutOfMemory);
  } catch (const std::exception& e) {
    if (std::ferror(stdout)) return static_cast<int>(ExitCode::OutputFailed);  // told with the exit code
    fmt::print(stderr, "internal error: {}\n", e.what());
    return static_cast<int>(ExitCode::Internal);
  }
}

}  // namespace

int main(int argc, char** argv) {
  braid::prepareStandardStreams();
  // Planes that one thread frees must serve another: with an arena for each, combining would take half as much again.
  mallopt(M_ARENA_MAX, 1);
  // Planes come and go. Given back to the system and taken anew, they would cost a fifth of the time of combining.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that is allowed
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  return braid::exitCodeAfterPrinting(run(argc, argv));
}
