// SPDX-License-Identifier: Apache-2.0
#include "tools/options/syntax/help_layout.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace braid {

namespace {

constexpr size_t kIndent = 2, kTextColumn = 30;

// The name of a value, and the range of numbers that CLI11 puts behind it.
struct ValueName {
  std::string name, range;
};

ValueName valueOf(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};  // a flag
  std::string type = option.get_type_name(), range;
  for (const char* words : {":from ", ":above "})
    if (const size_t at = type.find(words); at != std::string::npos) {
      range = type.substr(at + 1);
      type.resize(at);
    }
  const bool number = type == "UINT" || type == "INT" || type == "FLOAT";
  return {number ? "N" : type, range};
}

}  // namespace

std::string wrapped(const std::string& text, size_t indent) {
  std::string lines;
  size_t column = kHelpColumns;  // the first word begins a line
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find(' ', begin), text.size());
    const size_t length = end - begin;
    if (column + 1 + length > kHelpColumns) {
      lines += (lines.empty() ? "" : "\n") + std::string(indent, ' ');
      column = indent;
    } else {
      lines += ' ';
      ++column;
    }
    lines += text.substr(begin, length);
    column += length;
    begin = end + 1;
  }
  return lines + '\n';
}

std::string helpEntry(const std::string& name, const std::string& text) {
  const std::string first = std::string(kIndent, ' ') + name, rest = wrapped(text, kTextColumn);
  if (first.size() >= kTextColumn) return first + '\n' + rest;
  return first + rest.substr(first.size());
}

std::string helpEntry(const CLI::Option& option, bool ranges) {
  const ValueName value = valueOf(option);
  const bool optional = option.get_expected_min() == 0;
  std::string name = option.get_positional() ? option.get_name(true, false) : option.get_name(false, true);
  if (!value.name.empty() && !option.get_positional())
    name += optional ? fmt::format(" [{}]", value.name) : ' ' + value.name;
  std::string text = option.get_description();
  const std::string fallback = option.get_default_str();
  if (!fallback.empty() && text.find("(default") == std::string::npos) text += fmt::format(" (default {})", fallback);
  if (ranges && !value.range.empty()) text += fmt::format(" [{}]", value.range);
  if (option.get_required() && !option.get_positional()) text += " (required)";
  return helpEntry(name, text);
}

}  // namespace braid
