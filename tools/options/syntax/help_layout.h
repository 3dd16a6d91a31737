// SPDX-License-Identifier: Apache-2.0
// How options look in the help: two columns, lines of at most kHelpColumns.
#pragma once

#include <string>

namespace CLI {
class Option;
}

namespace braid {

inline constexpr size_t kHelpColumns = 100;

// A name and what is said of it, which may take several lines.
std::string helpEntry(const std::string& name, const std::string& text);

// Names, value, description and default; `ranges`: also which numbers it takes.
std::string helpEntry(const CLI::Option& option, bool ranges);

// The text in lines, broken at spaces.
std::string wrapped(const std::string& text, size_t indent);

}  // namespace braid
