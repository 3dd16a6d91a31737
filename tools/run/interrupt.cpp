// SPDX-License-Identifier: Apache-2.0
#include "tools/run/interrupt.h"

#include <csignal>
#include <unistd.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

std::atomic<bool> interrupted{false};

void onSignal(int) {
  // Files are written to a temporary name and renamed, so leaving at once keeps the last written ones intact.
  if (interrupted.exchange(true)) _exit(static_cast<int>(ExitCode::Interrupted));
}

}  // namespace

const std::atomic<bool>& installInterruptHandler() {
  static_assert(std::atomic<bool>::is_always_lock_free);
  struct sigaction action = {};
  action.sa_handler = onSignal;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // Whoever started this with nohup wants it to outlive the terminal.
  struct sigaction inherited = {};
  sigaction(SIGHUP, nullptr, &inherited);
  if (inherited.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  return interrupted;
}

}  // namespace braid
