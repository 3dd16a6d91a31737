// SPDX-License-Identifier: Apache-2.0
#include "tools/options/syntax/help.h"

#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "tools/options/syntax/help_layout.h"

namespace braid {

namespace {

using Scope = HelpRequest::Scope;

constexpr const char* kOtherOptions = "Options";  // the group that CLI11 puts options into

bool inShortHelp(const CLI::Option& o) { return o.get_group() != kOtherOptions && o.get_group() != kMethodOptions; }

// The options of a group, in the order in which they were added.
std::vector<const CLI::Option*> optionsOf(const CLI::App& command, const std::string& group) {
  return command.get_options([&](const CLI::Option* o) { return !o->get_positional() && o->get_group() == group; });
}

// The groups of the command in the order of their first options, what it writes and says behind the others.
std::vector<std::string> groupsOf(const CLI::App& command, bool all) {
  std::vector<std::string> groups = command.get_groups();
  std::erase_if(groups, [](const std::string& name) { return name == kOtherOptions || name == kMethodOptions; });
  for (const std::string last : {kOutputHelp, kLongHelp, kMessageHelp}) {
    const auto at = std::find(groups.begin(), groups.end(), last);
    if (at != groups.end()) std::rotate(at, at + 1, groups.end());
  }
  if (all || groups.empty()) groups.push_back(kOtherOptions);
  return groups;
}

std::string headOf(const CLI::App& command) {
  std::string usage = command.get_parent() ? "braid " + command.get_name() : "braid";
  std::string entries;
  for (const CLI::Option* o : command.get_options([](const CLI::Option* p) { return p->get_positional(); })) {
    usage += " " + o->get_name(true, false) + (o->get_expected_max() > 1 ? "..." : "");
    entries += helpEntry(*o, false);
  }
  usage += command.get_parent() ? " [OPTIONS]" : " [OPTIONS] COMMAND";
  return fmt::format("{}\nUsage: {}\n{}", command.get_description(), usage, entries);
}

std::string commandList(const CLI::App& app) {
  std::string text;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    text += helpEntry(sub->get_name(), sub->get_description());
  return text.empty() ? "" : "Commands:\n" + text;
}

// The options of one method that the command takes.
std::string methodText(const CLI::App& command, const Method& method) {
  std::string text = wrapped(fmt::format("{}: {}", method.name(), method.description()), 0);
  for (const OptionInfo& info : method.options())
    if (const CLI::Option* o = command.get_option_no_throw("--" + info.name)) text += helpEntry(*o, true);
  // What is no number: a folder that it reads.
  for (const CLI::Option* o : optionsOf(command, kMethodOptions))
    if ((o->get_type_name() == "FOLDER" || o->get_type_name() == "FILE") &&
        o->get_name().starts_with(fmt::format("--{}-", method.name())))
      text += helpEntry(*o, true);
  return text;
}

std::string allMethodsText(const CLI::App& command) {
  std::string text;
  for (const MethodKind kind : {MethodKind::Denoiser, MethodKind::Combiner}) {
    text += kind == MethodKind::Denoiser ? "Denoisers:\n" : "Combiners:\n";
    for (const auto& m : makeMethods())
      if (m->kind() == kind) text += methodText(command, *m);
  }
  return text;
}

std::string oneMethodText(const CLI::App& command, const std::string& name) {
  std::vector<std::string> known;
  for (const auto& m : makeMethods()) {
    if (m->name() == name) return methodText(command, *m);
    known.push_back(m->name());
  }
  throw Error(ExitCode::Usage,
              fmt::format("-h {}: no denoiser or combiner of this name: known are {}", name, fmt::join(known, ", ")));
}

std::string commandText(const CLI::App& command, bool all) {
  std::string text = headOf(command) + commandList(command);
  bool hides = false;
  const bool chosen = !groupsOf(command, false).empty() && groupsOf(command, false).front() != kOtherOptions;
  for (const CLI::Option* o : command.get_options()) hides |= chosen && !o->get_positional() && !inShortHelp(*o);
  for (const std::string& group : groupsOf(command, all)) {
    text += (group == kOtherOptions && chosen ? "More options" : group) + ":\n";
    for (const CLI::Option* o : optionsOf(command, group)) text += helpEntry(*o, all);
  }
  const bool methods = !optionsOf(command, kMethodOptions).empty();
  if (!command.get_footer().empty()) text += command.get_footer() + '\n';
  if (all && methods) text += '\n' + allMethodsText(command);
  if (!all && hides)
    text += methods ? "More help: --help-all every option, --help-methods denoisers and combiners, -h METHOD one of "
                      "them.\n"
                    : "More help: --help-all every option.\n";
  return text;
}

const CLI::App* commandOf(const CLI::App& app, const std::string& name) {
  const auto found = app.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

// Words beside -h that name no method: the scene of a command that was to be run, say.
bool isMethodName(const std::string& word) {
  return !word.empty() && word[0] != '-' && word.find_first_of("./,{ ") == std::string::npos;
}

}  // namespace

void showFirst(CLI::App& command, const char* heading, const std::vector<std::string>& options) {
  for (const std::string& name : options) command.get_option(name)->group(heading);
}

void useShortHelp(CLI::App& app) {
  app.formatter_fn([](const CLI::App* command, const std::string&, CLI::AppFormatMode mode) {
    return commandText(*command, mode != CLI::AppFormatMode::Normal);
  });
}

std::optional<HelpRequest> findHelp(const CLI::App& app, const std::vector<std::string>& arguments) {
  HelpRequest request;
  bool found = false;
  for (size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string& word = arguments[i];
    if (request.command.empty() && commandOf(app, word)) request.command = word;
    if (word == "--help-all") request.scope = Scope::All;
    if (word == "--help-methods") request.scope = Scope::Methods;
    const bool help = word == "-h" || word == "--help";
    found = found || help || word == "--help-all" || word == "--help-methods";
    const std::string next = i + 1 < arguments.size() ? arguments[i + 1] : "";
    if (!help || !isMethodName(next) || commandOf(app, next)) continue;
    request.scope = Scope::Method;
    request.method = next.substr(0, next.find_first_of("@:"));
  }
  return found ? std::optional(request) : std::nullopt;
}

std::string helpText(const CLI::App& app, const HelpRequest& request) {
  const CLI::App& command = request.command.empty() ? app : *commandOf(app, request.command);
  switch (request.scope) {
    case Scope::Method:
      return oneMethodText(command, request.method);
    case Scope::Methods:
      return allMethodsText(command);
    case Scope::Short:
    case Scope::All:
      break;
  }
  return commandText(command, request.scope == Scope::All);
}

}  // namespace braid
