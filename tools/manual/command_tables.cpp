// SPDX-License-Identifier: Apache-2.0
#include "tools/manual/command_tables.h"

#include <CLI/CLI.hpp>

namespace braid {

namespace {

OptionRow rowOf(const CLI::Option& o) {
  OptionRow row;
  for (const std::string& name : o.get_snames()) row.names.push_back("-" + name);
  for (const std::string& name : o.get_lnames()) row.names.push_back("--" + name);
  if (row.names.empty()) row.names.push_back(o.get_name(true, false));
  if (o.get_expected_min() > 0) row.value = o.get_type_name();
  row.description = o.get_description();
  if (!o.get_default_str().empty()) row.description += " (default " + o.get_default_str() + ")";
  return row;
}

}  // namespace

std::vector<const CLI::App*> commandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<OptionRow> positionals(const CLI::App& command) {
  std::vector<OptionRow> rows;
  for (const CLI::Option* o : command.get_options([](const CLI::Option* p) { return p->get_positional(); }))
    rows.push_back(rowOf(*o));
  return rows;
}

std::vector<OptionGroup> optionGroups(const CLI::App& command) {
  std::vector<OptionGroup> groups;
  for (const std::string& heading : command.get_groups()) {
    if (heading.empty()) continue;  // hidden
    OptionGroup group{heading, {}};
    for (const CLI::Option* o :
         command.get_options([&](const CLI::Option* p) { return !p->get_positional() && p->get_group() == heading; }))
      group.rows.push_back(rowOf(*o));
    if (!group.rows.empty()) groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace braid
