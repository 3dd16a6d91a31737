// SPDX-License-Identifier: Apache-2.0
// SIGINT and SIGTERM: the first asks the render to finish its pass and save, the second ends the process at once.
#pragma once

#include <atomic>

namespace braid {

// Installs the handlers and returns the flag that the first signal sets.
const std::atomic<bool>& installInterruptHandler();

}  // namespace braid
