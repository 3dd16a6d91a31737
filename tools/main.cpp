// SPDX-License-Identifier: Apache-2.0
// The braid command line: one subcommand a file; errors end here as one line and an exit code.
#include <malloc.h>

#include <cstdio>
#include <limits>
#include <new>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/cli.h"
#include "tools/lists.h"
#include "tools/memory_plan.h"
#include "version.h"

int main(int argc, char** argv) {
  using namespace braid;
  // Planes that one thread frees must serve another: with an arena for each, combining would take half as much again.
  mallopt(M_ARENA_MAX, 1);
  // Planes come and go. Given back to the system and taken anew, they would cost a fifth of the time of combining.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that is allowed
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  CLI::App app{"braid: renders glTF scenes to converged OpenEXR images on the CPU"};
  app.set_version_flag("--version", std::string("braid ") + BRAID_VERSION + " (" + BRAID_BUILD_FLAGS + ")");
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.require_subcommand(0, 1);
  bool list = false;
  app.add_flag("--list", list, "Print every registered integrator, denoiser, combiner and metric");
  std::string memoryLimit;
  app.add_option("--memory-limit", memoryLimit, "Memory that may be taken, such as 4G; beyond it: exit code 5");
  app.fallthrough();
  Action action;
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

  try {
    app.parse(argc, argv);
    if (list) return printLists();
    if (!action) {
      fmt::print("{}", app.help());
      return static_cast<int>(ExitCode::Usage);
    }
    if (!memoryLimit.empty()) limitMemory(parseBytes(memoryLimit));
    return action();
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(ExitCode::Usage);
  } catch (const Error& e) {
    fmt::print(stderr, "{}\n", e.what());
    return static_cast<int>(e.code());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "out of memory: lower --size or give the process more, by --memory-limit if there is one\n");
    return static_cast<int>(ExitCode::OutOfMemory);
  } catch (const std::exception& e) {
    fmt::print(stderr, "internal error: {}\n", e.what());
    return static_cast<int>(ExitCode::Internal);
  }
}
