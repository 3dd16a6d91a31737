// SPDX-License-Identifier: Apache-2.0
// Three kinds of error: BRAID_ASSERT = our bug; an Error exception = bad input or a resource that failed; optional = an
// expected miss.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace braid {

// Process exit codes of the command line (the library itself only throws).
enum class ExitCode {
  Ok = 0,
  Usage = 1,
  BadInput = 2,
  OutputFailed = 3,
  UnsupportedExtension = 4,
  OutOfMemory = 5,
  TargetNotReached = 6,
  Internal = 70,
  Interrupted = 130,
};

// One line that names the file, the place in it and the mend; carries the exit code the command line should end with.
class Error : public std::runtime_error {
 public:
  // Control characters, which names in a file may hold, become '?': they could end the line or steer a terminal.
  Error(ExitCode code, const std::string& text);
  ExitCode code() const { return code_; }

 protected:
  struct Lines {
    std::string text;
  };
  Error(ExitCode code, const Lines& lines) : std::runtime_error(lines.text), code_(code) {}

 private:
  ExitCode code_;
};

// `text` with '?' for control characters.
std::string printable(std::string text);

// One problem of an input file.
struct Problem {
  std::string place;  // JSON pointer such as /meshes/0/primitives/1/indices, or empty for the whole file
  std::string text;   // what is wrong and how to mend it
};

// All problems of one scene file, one line each: "FILE: /json/pointer: text".
class SceneError : public Error {
 public:
  SceneError(ExitCode code, std::string file, std::vector<Problem> problems);
  SceneError(ExitCode code, std::string file, std::string place, std::string text);
  const std::vector<Problem>& problems() const { return problems_; }

 private:
  std::vector<Problem> problems_;
};

[[noreturn]] void assertionFailed(const char* condition, const char* file, int line);

}  // namespace braid

// Checks an invariant of braid's own code; throws Error(Internal) naming the line.
#define BRAID_ASSERT(condition) ((condition) ? void(0) : ::braid::assertionFailed(#condition, __FILE__, __LINE__))
