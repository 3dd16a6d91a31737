// SPDX-License-Identifier: Apache-2.0
// SIGINT, SIGTERM and SIGHUP: the first asks the render to finish its pass and save, the second ends the process at
// once. A SIGHUP that is ignored already, as by nohup, stays ignored.
#pragma once

#include <atomic>

namespace braid {

// Installs the handlers and returns the flag that the first signal sets.
const std::atomic<bool>& installInterruptHandler();

}  // namespace braid
