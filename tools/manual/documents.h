// SPDX-License-Identifier: Apache-2.0
// What a package holds beside programs and libraries, written where it is asked for.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace braid {

// man/*.1, bash/braid and zsh/_braid in the folder. Throws Error(OutputFailed) naming what cannot be written.
void writeDocuments(const CLI::App& app, const std::string& folder);

}  // namespace braid
