// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/external/shell_command.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/core/stopwatch.h"

extern char** environ;

namespace braid {

namespace {

constexpr std::chrono::milliseconds kPoll(2);
constexpr size_t kLongestLine = 200;

std::string lastLine(const std::string& file) {
  std::ifstream in(file);
  std::string last;
  for (std::string line; std::getline(in, line);)
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
  return last.substr(0, kLongestLine);
}

// The shell in a process group of its own, by which it can be ended with all that it started.
pid_t startShell(const std::string& command, const std::string& log) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&files, 1, 2);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
  sigset_t none, usual;
  sigemptyset(&none);
  sigemptyset(&usual);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXFSZ}) sigaddset(&usual, signal);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &usual);
  std::string shell = "sh", flag = "-c", text = command;
  char* const arguments[] = {shell.data(), flag.data(), text.data(), nullptr};
  pid_t child = 0;
  const int failure = posix_spawn(&child, "/bin/sh", &files, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (failure != 0)
    throw Error(ExitCode::BadInput, fmt::format("/bin/sh cannot be started: {}", std::strerror(failure)));
  return child;
}

void endGroup(pid_t child) {
  ::kill(-child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
}

std::string howItEnded(int status) {
  if (WIFSIGNALED(status)) return fmt::format("was ended by signal {}", WTERMSIG(status));
  const int code = WEXITSTATUS(status);
  return code == 127 ? "was not found (exit code 127)" : fmt::format("failed with exit code {}", code);
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::error_code failure;
  std::string name = (std::filesystem::temp_directory_path(failure) / "braid-XXXXXX").string();
  if (failure || !::mkdtemp(name.data()))
    throw Error(ExitCode::OutputFailed,
                fmt::format("{}: no folder for temporary files can be made there: {}; set TMPDIR to another place",
                            name, failure ? failure.message() : std::strerror(errno)));
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string shellWord(const std::string& text) {
  const char* harmless = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789/._-+";
  if (!text.empty() && text.find_first_not_of(harmless) == std::string::npos) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

void runShellCommand(const std::string& command, const std::string& log, double seconds,
                     const std::atomic<bool>* cancel) {
  const auto fail = [&](const std::string& how) {
    const std::string line = lastLine(log);
    throw Error(ExitCode::BadInput, fmt::format("the command {}{}", how, line.empty() ? "" : ": " + line));
  };
  const Stopwatch clock;
  const pid_t child = startShell(command, log);
  int status = 0;
  for (pid_t ended = 0; ended != child;) {
    ended = ::waitpid(child, &status, WNOHANG);
    if (ended < 0 && errno != EINTR) fail("cannot be waited for");
    if (ended == child) break;
    if (clock.seconds() > seconds) {
      endGroup(child);
      fail(fmt::format("took longer than {} s", seconds));
    }
    if (cancel && cancel->load()) {
      endGroup(child);
      return;
    }
    std::this_thread::sleep_for(kPoll);
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) fail(howItEnded(status));
}

}  // namespace braid
