// SPDX-License-Identifier: Apache-2.0
// What numbers options take. Every option whose value holds numbers has one of these checks, so that what is no number,
// not finite, followed by anything else or out of its range ends in exit code 1 with the range, before any work.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "combiners/method.h"

namespace braid {

// The name of all these checks, by which the test that walks over all options knows those of numbers.
inline constexpr const char* kNumberCheck = "numbers";

enum class Ends { Included, LeastExcluded, MostExcluded, Excluded };

// Bounds that mean no more than that floats hold the number and what is made of it.
inline constexpr double kLargeNumber = 1e20;
inline constexpr uint64_t kMostSamples = uint64_t(1) << 40;

CLI::Validator wholeNumber(uint64_t least, uint64_t most);
CLI::Validator anySeed();
CLI::Validator number(double least, double most, Ends ends = Ends::Included);
CLI::Validator numberOf(const OptionInfo& option);
// --threads, which many subcommands have.
CLI::Option* addThreads(CLI::App& command, int& threads);

// What the parser says when it throws; nothing if it does not.
std::string complaint(const std::function<void(const std::string&)>& parser, const std::string& text);

// An option whose value the parser makes of a text without numbers.
template <class T, class Parser>
CLI::Option* addWords(CLI::App& command, const std::string& names, T& value, Parser parser,
                      const std::string& description) {
  return command.add_option_function<std::string>(
      names, [&value, parser](const std::string& text) { value = parser(text); }, description);
}

// The same of a text with numbers; what the parser throws is the complaint of a check.
template <class T, class Parser>
CLI::Option* addParsed(CLI::App& command, const std::string& names, T& value, Parser parser,
                       const std::string& description) {
  CLI::Validator check{
      [parser](std::string& text) { return complaint([&](const std::string& t) { (void)parser(t); }, text); }, "",
      kNumberCheck};
  return addWords(command, names, value, parser, description)->check(std::move(check));
}

[[noreturn]] void throwUnknown(const std::string& what, const std::string& name, const std::vector<std::string>& known);

// The values of an option by their names, and what the option is about.
template <class T>
struct NamedValues {
  const char* what;
  const std::vector<std::pair<std::string, T>>& values;

  // Throws Error(Usage) with the known names.
  T parse(const std::string& name) const {
    std::vector<std::string> known;
    for (const auto& [key, value] : values) {
      if (key == name) return value;
      known.push_back(key);
    }
    throwUnknown(what, name, known);
  }
};
// An option that takes one of the names, with its present value as the default.
template <class T>
CLI::Option* addNamed(CLI::App& command, const std::string& names, T& value, const NamedValues<T>& named,
                      const std::string& description) {
  const auto parse = [named](const std::string& name) { return named.parse(name); };
  CLI::Option* option = addWords(command, names, value, parse, description)->type_name("NAME");
  for (const auto& [key, one] : named.values)
    if (one == value) option->default_str(key);
  return option;
}

// An option that takes names between commas, with its present value as the default.
CLI::Option* addList(CLI::App& command, const std::string& names, std::vector<std::string>& value,
                     const std::string& description);

}  // namespace braid
