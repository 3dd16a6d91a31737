// SPDX-License-Identifier: Apache-2.0
// Pages for man, from the tables of the command line.
#pragma once

#include <map>
#include <string>

namespace CLI {
class App;
}

namespace braid {

// By file name, "braid.1" and "braid-render.1", …: roff with every option of every command.
std::map<std::string, std::string> manualPages(const CLI::App& app);

}  // namespace braid
