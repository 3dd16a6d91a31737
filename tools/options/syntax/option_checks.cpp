// SPDX-License-Identifier: Apache-2.0
#include "tools/options/syntax/option_checks.h"

#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "renderer/core/error.h"
#include "tools/options/syntax/option_texts.h"

namespace braid {

namespace {

// The whole text as a number of this kind, without a sign that says nothing.
template <class T>
bool isNumber(const std::string& text, T& value) {
  const size_t begin = text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0;
  const auto [end, error] = std::from_chars(text.data() + begin, text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

std::string rangeText(double least, double most, Ends ends) {
  return fmt::format("{} {:g} {} {:g}", ends == Ends::LeastExcluded || ends == Ends::Excluded ? "above" : "from", least,
                     ends == Ends::MostExcluded || ends == Ends::Excluded ? "to below" : "to", most);
}

bool within(double v, double least, double most, Ends ends) {
  const bool above = ends == Ends::LeastExcluded || ends == Ends::Excluded ? v > least : v >= least;
  const bool below = ends == Ends::MostExcluded || ends == Ends::Excluded ? v < most : v <= most;
  return above && below;
}

}  // namespace

CLI::Validator wholeNumber(uint64_t least, uint64_t most) {
  const std::string range = fmt::format("from {} to {}", least, most);
  return {[=](std::string& text) {
            uint64_t value = 0;
            if (!isNumber(text, value) || value < least || value > most)
              return fmt::format("'{}': expected a whole number {}", text, range);
            text = std::to_string(value);  // CLI11 takes leading zeros for octal
            return std::string();
          },
          range, kNumberCheck};
}

CLI::Validator number(double least, double most, Ends ends) {
  const std::string range = rangeText(least, most, ends);
  return {[=](std::string& text) {
            double value = 0;
            if (!isNumber(text, value) || !std::isfinite(value) || !within(value, least, most, ends))
              return fmt::format("'{}': expected a number {}", text, range);
            return std::string();
          },
          range, kNumberCheck};
}

CLI::Validator numberOf(const OptionInfo& o) {
  return o.whole ? wholeNumber(static_cast<uint64_t>(o.least), static_cast<uint64_t>(o.most)) : number(o.least, o.most);
}

CLI::Validator anySeed() { return wholeNumber(0, std::numeric_limits<uint64_t>::max()); }

std::string complaint(const std::function<void(const std::string&)>& parser, const std::string& text) {
  try {
    parser(text);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

void throwUnknown(const std::string& what, const std::string& name, const std::vector<std::string>& known) {
  throw Error(ExitCode::Usage, fmt::format("unknown {} '{}': known are {}", what, name, fmt::join(known, ", ")));
}

CLI::Option* addList(CLI::App& command, const std::string& names, std::vector<std::string>& value,
                     const std::string& description) {
  return addWords(command, names, value, splitList, description)->default_str(joinList(value))->type_name("NAMES");
}

CLI::Option* addThreads(CLI::App& command, int& threads) {
  return command.add_option("--threads", threads, "Worker threads (default: all)")->check(wholeNumber(0, 4096));
}

}  // namespace braid
