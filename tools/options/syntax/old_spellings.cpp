// SPDX-License-Identifier: Apache-2.0
#include "tools/options/syntax/old_spellings.h"

#include <array>
#include <string_view>

namespace braid {

namespace {

struct Spelling {
  std::string_view old, present;
};

constexpr std::array kSpellings = {
    Spelling{"--light-parts", "--direct-indirect"},
    Spelling{"--auto-light-parts", "--auto-direct-indirect"},
    Spelling{"--auto-second-pass", "--auto-refilter"},
    Spelling{"--auto-despike", "--auto-remove-fireflies"},
    Spelling{"--nfor-despike", "--nfor-remove-fireflies"},
    Spelling{"--rdfc-despike", "--rdfc-remove-fireflies"},
    Spelling{"--double-shrinkage-despike", "--double-shrinkage-remove-fireflies"},
};

std::string presentSpelling(const std::string& argument) {
  const std::string name = argument.substr(0, argument.find('='));
  for (const Spelling& s : kSpellings)
    if (name == s.old) return std::string(s.present) + argument.substr(name.size());
  return argument;
}

}  // namespace

std::vector<std::string> presentSpellings(int argc, const char* const* argv) {
  std::vector<std::string> arguments(argv, argv + argc);
  for (std::string& argument : arguments) {
    if (argument == "--") break;
    argument = presentSpelling(argument);
  }
  return arguments;
}

}  // namespace braid
