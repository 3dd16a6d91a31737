// SPDX-License-Identifier: Apache-2.0
// The command line as tables: what pages and completions are made of.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace braid {

struct OptionRow {
  std::vector<std::string> names;  // "-o", "--output"; of an argument its name alone
  std::string value;               // "FILE"; empty: a flag
  std::string description;
};

struct OptionGroup {
  std::string heading;
  std::vector<OptionRow> rows;
};

std::vector<const CLI::App*> commandsOf(const CLI::App& app);
// The arguments of a command in their order.
std::vector<OptionRow> positionals(const CLI::App& command);
// Its options, those of methods last. Spellings of earlier versions are not among them.
std::vector<OptionGroup> optionGroups(const CLI::App& command);

}  // namespace braid
