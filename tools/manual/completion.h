// SPDX-License-Identifier: Apache-2.0
// Completion for shells, from the tables of the command line.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace braid {

// Scripts that complete commands, options, and the names of integrators and methods; else files.
std::string bashCompletion(const CLI::App& app);
std::string zshCompletion(const CLI::App& app);

}  // namespace braid
