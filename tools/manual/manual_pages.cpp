// SPDX-License-Identifier: Apache-2.0
#include "tools/manual/manual_pages.h"

#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "tools/manual/command_tables.h"
#include "version.h"

namespace braid {

namespace {

// Text of roff: no character of it is a command.
std::string roff(const std::string& text) {
  std::string out;
  bool lineBegins = true;
  for (const char c : text) {
    if (lineBegins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
    lineBegins = c == '\n';
  }
  return out;
}

std::string head(const std::string& name, const std::string& description) {
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(), [](char c) { return static_cast<char>(std::toupper(c)); });
  return fmt::format(".TH \"{}\" 1 \"\" \"braid {}\" \"braid\"\n.SH NAME\n{} \\- {}\n", roff(title), BRAID_VERSION,
                     roff(name), roff(description));
}

std::string entry(const OptionRow& row) {
  std::string names;
  for (const std::string& name : row.names) names += (names.empty() ? "\\fB" : ", \\fB") + roff(name) + "\\fR";
  if (!row.value.empty()) names += " \\fI" + roff(row.value) + "\\fR";
  return fmt::format(".TP\n{}\n{}\n", names, roff(row.description));
}

std::string options(const CLI::App& command) {
  std::string text;
  for (const OptionGroup& group : optionGroups(command)) {
    text += fmt::format(".SS {}\n", roff(group.heading));
    for (const OptionRow& row : group.rows) text += entry(row);
  }
  return text.empty() ? "" : ".SH OPTIONS\n" + text;
}

constexpr const char* kExitStatus =
    ".SH EXIT STATUS\n"
    ".TP\n0\ndone\n"
    ".TP\n1\nwrong usage\n"
    ".TP\n2\na file cannot be used\n"
    ".TP\n3\nthe output cannot be written\n"
    ".TP\n4\nthe scene requires an extension that braid does not have\n"
    ".TP\n5\nnot enough memory\n"
    ".TP\n6\na limit was not met, or images differ\n"
    ".TP\n70\nan error of braid itself\n"
    ".TP\n130\ninterrupted; what was rendered is saved\n";

std::string commandPage(const CLI::App& command) {
  const std::string name = "braid-" + command.get_name();
  std::string text = head(name, command.get_description());
  text += fmt::format(".SH SYNOPSIS\n\\fBbraid {}\\fR", roff(command.get_name()));
  for (const OptionRow& row : positionals(command)) text += fmt::format(" \\fI{}\\fR", roff(row.names.front()));
  text += " [\\fIoptions\\fR]\n";
  if (const std::vector<OptionRow> rows = positionals(command); !rows.empty()) {
    text += ".SH ARGUMENTS\n";
    for (const OptionRow& row : rows) text += entry(row);
  }
  text += options(command);
  if (!command.get_footer().empty()) text += ".SH EXAMPLES\n.nf\n" + roff(command.get_footer()) + "\n.fi\n";
  return text + kExitStatus + ".SH SEE ALSO\n\\fBbraid\\fR(1)\n";
}

}  // namespace

std::map<std::string, std::string> manualPages(const CLI::App& app) {
  std::map<std::string, std::string> pages;
  std::string commands, also;
  for (const CLI::App* command : commandsOf(app)) {
    const std::string name = command->get_name();
    pages[fmt::format("braid-{}.1", name)] = commandPage(*command);
    commands += fmt::format(".TP\n\\fB{}\\fR\n{}\n", roff(name), roff(command->get_description()));
    also += fmt::format("{}\\fBbraid\\-{}\\fR(1)", also.empty() ? "" : ",\n", roff(name));
  }
  pages["braid.1"] = head("braid", "renders glTF scenes to converged OpenEXR images on the CPU") +
                     ".SH SYNOPSIS\n\\fBbraid\\fR \\fIcommand\\fR [\\fIoptions\\fR]\n.SH COMMANDS\n" + commands +
                     options(app) + kExitStatus + ".SH SEE ALSO\n" + also + "\n";
  return pages;
}

}  // namespace braid
