// SPDX-License-Identifier: Apache-2.0
// Help at three lengths: what a user needs at first, on one screen; the options of methods; everything.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace braid {

// The group of options that methods have, which only the help of methods and that of everything show.
inline constexpr const char* kMethodOptions = "Options of methods";

// Headings that several commands have in their short help.
inline constexpr const char *kSceneHelp = "Scene and view", *kSampleHelp = "Samples", *kOutputHelp = "Output",
                            *kLongHelp = "Long renders", *kMessageHelp = "Messages";

// Has the short help show these options of the command, which it has already, under the heading. It shows all options
// of a command that chooses none.
void showFirst(CLI::App& command, const char* heading, const std::vector<std::string>& options);

// Makes the short help that of -h, for this and for the subcommands that it gets afterwards.
void useShortHelp(CLI::App& app);

struct HelpRequest {
  enum class Scope { Short, Method, Methods, All } scope = Scope::Short;
  std::string command;  // empty: braid itself
  std::string method;   // of Scope::Method
};
// What -h, --help, --help-methods or --help-all among the arguments asks for, whatever stands beside them.
std::optional<HelpRequest> findHelp(const CLI::App& app, const std::vector<std::string>& arguments);

// Throws Error(Usage) for an unknown method, with the known ones.
std::string helpText(const CLI::App& app, const HelpRequest& request);

}  // namespace braid
