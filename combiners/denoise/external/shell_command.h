// SPDX-License-Identifier: Apache-2.0
// Runs a command of the shell and waits for it; a folder for the files that it reads and writes.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>

namespace braid {

// A folder of its own among the temporary ones, gone with all that is in it when this goes. Throws Error(OutputFailed).
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

// The text as one word of a shell's command line.
std::string shellWord(const std::string& text);

// Runs `/bin/sh -c command` with nothing to read; what it prints goes to the file `log`. It and what it started are
// ended after so many seconds, or soon after `cancel` is set. Throws Error(BadInput) saying how it failed, with the
// last line that it printed.
void runShellCommand(const std::string& command, const std::string& log, double seconds,
                     const std::atomic<bool>* cancel);

}  // namespace braid
