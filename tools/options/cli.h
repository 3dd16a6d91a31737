// SPDX-License-Identifier: Apache-2.0
// The command line: what a subcommand is, and all of them.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace braid {

// A subcommand sets this to what main() should run; it returns the exit code.
using Action = std::function<int()>;

void addRender(CLI::App& app, Action& action);
void addPreview(CLI::App& app, Action& action);
void addPlan(CLI::App& app, Action& action);
void addInfo(CLI::App& app, Action& action);
void addBench(CLI::App& app, Action& action);
void addReplay(CLI::App& app, Action& action);
void addCompare(CLI::App& app, Action& action);
void addCombine(CLI::App& app, Action& action);
void addMerge(CLI::App& app, Action& action);
void addSweep(CLI::App& app, Action& action);

// The options of braid itself, and all subcommands.
struct MainOptions {
  std::string documents;     // folder that gets man pages and completions; empty: none
  uint64_t memoryLimit = 0;  // bytes, 0: none of our own
};
void addCommands(CLI::App& app, MainOptions& options, Action& action);

}  // namespace braid
