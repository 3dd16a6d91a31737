// SPDX-License-Identifier: Apache-2.0
#include "tools/manual/completion.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "combiners/pipeline/registry.h"
#include "integrators/registry.h"
#include "tools/manual/command_tables.h"

namespace braid {

namespace {

std::string integratorNames() {
  std::string names = "auto";
  for (const auto& i : makeIntegrators()) names += fmt::format(" {}", i->name());
  return names;
}

std::string methodNames() {
  std::string names = "none";
  for (const auto& m : makeMethods()) names += fmt::format(" {}", m->name());
  return names;
}

std::string optionNames(const CLI::App& command) {
  std::string names;
  for (const OptionGroup& group : optionGroups(command))
    for (const OptionRow& row : group.rows)
      for (const std::string& name : row.names) names += (names.empty() ? "" : " ") + name;
  return names;
}

// Text between brackets and quotes of a zsh specification.
std::string zshText(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'')
      out += "'\\''";
    else if (c == '[' || c == ']' || c == ':' || c == '\\')
      (out += '\\') += c;
    else
      out += c == '\n' ? ' ' : c;
  }
  return out;
}

std::string zshValues(const OptionRow& row) {
  if (row.value.empty()) return "";
  const std::string& name = row.names.back();
  const std::string what = zshText(row.value);
  if (name == "--integrator") return fmt::format(":{}:({})", what, integratorNames());
  if (name == "--combine" || name == "--denoiser" || name == "--method")
    return fmt::format(":{}:({})", what, methodNames());
  if (row.value == "FOLDER") return fmt::format(":{}:_files -/", what);
  return fmt::format(":{}:_files", what);
}

std::string zshRow(const OptionRow& row) {
  std::string text;
  for (const std::string& name : row.names)
    text += fmt::format(" \\\n    '{}[{}]{}'", name, zshText(row.description), zshValues(row));
  return text;
}

}  // namespace

std::string bashCompletion(const CLI::App& app) {
  std::string commands, cases;
  for (const CLI::App* command : commandsOf(app)) {
    commands += (commands.empty() ? "" : " ") + command->get_name();
    cases += fmt::format("    {}) options=\"{}\" ;;\n", command->get_name(), optionNames(*command));
  }
  return fmt::format(
      "# bash completion of braid\n"
      "_braid() {{\n"
      "  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} options=\"{}\" word\n"
      "  COMPREPLY=()\n"
      "  case $before in\n"
      "    --integrator) COMPREPLY=($(compgen -W \"{}\" -- \"$current\")); return ;;\n"
      "    --combine|--denoiser|--method) COMPREPLY=($(compgen -W \"{}\" -- \"$current\")); return ;;\n"
      "  esac\n"
      "  if ((COMP_CWORD == 1)) && [[ $current != -* ]]; then\n"
      "    COMPREPLY=($(compgen -W \"{}\" -- \"$current\")); return\n"
      "  fi\n"
      "  case ${{COMP_WORDS[1]}} in\n{}  esac\n"
      "  [[ $current == -* ]] && COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n"
      "}}\n"
      "complete -o bashdefault -o default -F _braid braid\n",
      optionNames(app), integratorNames(), methodNames(), commands, cases);
}

std::string zshCompletion(const CLI::App& app) {
  std::string commands, cases;
  for (const CLI::App* command : commandsOf(app)) {
    commands += fmt::format(" '{}:{}'", command->get_name(), zshText(command->get_description()));
    cases += fmt::format("  {})\n    _arguments -s", command->get_name());
    for (const OptionGroup& group : optionGroups(*command))
      for (const OptionRow& row : group.rows) cases += zshRow(row);
    cases += " \\\n    '*:file:_files' ;;\n";
  }
  return fmt::format(
      "#compdef braid\n"
      "local -a commands\n"
      "commands=({})\n"
      "if ((CURRENT == 2)); then\n  _describe command commands\n  return\nfi\n"
      "local command=$words[2]\n"
      "shift words\n((CURRENT--))\n"
      "case $command in\n{}esac\n",
      commands.substr(1), cases);
}

}  // namespace braid
