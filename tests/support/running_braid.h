// SPDX-License-Identifier: Apache-2.0
// A braid that runs while a test looks at its files and sends it signals.
#pragma once

#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <spawn.h>

#include "tests/support/command_line.h"

namespace braid::test {

inline const std::string kCornellFile = BRAID_SOURCE_DIR "/scenes/cornell.glb";

// Complete lines only: a killed process may have begun one more.
inline std::vector<Json> records(const fs::path& path) {
  std::vector<Json> all;
  const std::string text = readText(path);
  for (size_t begin = 0, end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1)
    all.push_back(Json::parse(text.substr(begin, end - begin)));
  return all;
}

inline std::vector<Json> records(const fs::path& path, const std::string& event) {
  std::vector<Json> some;
  for (const Json& r : records(path))
    if (r["event"] == event) some.push_back(r);
  return some;
}

// A command of braid on a scene, the Cornell box; what it prints goes to the test's own output or to the file named.
class Process {
 public:
  explicit Process(std::vector<std::string> words, const std::string& command = "render", const fs::path& printed = {},
                   const std::string& scene = kCornellFile) {
    words.insert(words.begin(), {BRAID_BINARY, command, scene, "-q"});
    if (command == "render") makePlain(words);
    std::vector<char*> arguments;
    for (std::string& w : words) arguments.push_back(w.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    if (!printed.empty())
      posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, printed.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const int failure = posix_spawn(&child_, BRAID_BINARY, &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    REQUIRE(failure == 0);
  }
  ~Process() {
    if (child_ == 0) return;
    ::kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const { REQUIRE(::kill(child_, number) == 0); }
  // The exit code, or minus the signal that ended it.
  int wait() {
    int status = 0;
    REQUIRE(waitpid(child_, &status, 0) == child_);
    child_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

 private:
  // Like plainly().
  static void makePlain(std::vector<std::string>& words) {
    for (const auto& [option, value] :
         {std::pair("--integrator", "pt"), std::pair("--combine", "none"), std::pair("--aovs", "all")})
      if (std::find(words.begin(), words.end(), option) == words.end()) words.insert(words.end(), {option, value});
  }

  pid_t child_ = 0;
};

inline void sleepFor(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

template <class Done>
bool waitUntil(const Done& done) {
  for (int i = 0; i < 15000; ++i) {
    if (done()) return true;
    sleepFor(0.002);
  }
  return false;
}

}  // namespace braid::test
