// SPDX-License-Identifier: Apache-2.0
// Messages leave the library through one callback, so that it never prints by itself.
#pragma once

#include <functional>
#include <string>

namespace braid {

enum class LogLevel { Warning, Info, Debug };

// Receives one line without a newline. May be called from any thread.
using LogSink = std::function<void(LogLevel, const std::string&)>;

}  // namespace braid
