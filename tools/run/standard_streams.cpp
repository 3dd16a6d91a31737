// SPDX-License-Identifier: Apache-2.0
#include "tools/run/standard_streams.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <iostream>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

// Open gives the lowest number that is free. Nothing can be written to one opened for reading: a result is missed.
void takeClosedDescriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
      (void)::open("/dev/null", descriptor == STDERR_FILENO ? O_WRONLY : O_RDONLY);
}

ssize_t writeMessage(void* /*cookie*/, const char* text, size_t size) {
  for (size_t done = 0; done < size;) {
    const ssize_t written = ::write(STDERR_FILENO, text + done, size - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) break;
    done += static_cast<size_t>(written);
  }
  return static_cast<ssize_t>(size);
}

// fmt::print() throws when it cannot write: a render must not end because its terminal has.
void tolerateStandardError() {
#ifdef __GLIBC__
  if (std::FILE* tolerant = ::fopencookie(nullptr, "w", {nullptr, writeMessage, nullptr, nullptr})) {
    std::setvbuf(tolerant, nullptr, _IONBF, 0);
    stderr = tolerant;  // a variable like any other, says the manual of the GNU C library
  }
#endif
}

// Unlike an ignored signal, a handler does not pass to programs that are started.
void surviveSignal(int number) {
  struct sigaction action = {};
  action.sa_handler = [](int) {};
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(number, &action, nullptr);
}

}  // namespace

void prepareStandardStreams() {
  takeClosedDescriptors();
  tolerateStandardError();
  surviveSignal(SIGPIPE);
  surviveSignal(SIGXFSZ);
}

int exitCodeAfterPrinting(int code) {
  errno = 0;
  std::cout.flush();
  const bool flushed = std::fflush(stdout) == 0;
  if (flushed && std::ferror(stdout) == 0 && std::cout.good()) return code;
  fmt::print(stderr, "standard output: cannot be written{}{}: free some space, or write elsewhere\n",
             errno != 0 ? ": " : "", errno != 0 ? std::strerror(errno) : "");
  return code == static_cast<int>(ExitCode::Interrupted) ? code : static_cast<int>(ExitCode::OutputFailed);
}

}  // namespace braid
