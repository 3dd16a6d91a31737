// SPDX-License-Identifier: Apache-2.0
// Man pages and completions: every command and every option is in them, and shells and man read them.
#include <doctest/doctest.h>

#include "tests/support/command_line.h"
#include "tests/support/contains.h"
#include "tests/support/running_braid.h"

namespace braid::test_manual {

using namespace test;

namespace {

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out(1);
  for (const char c : text)
    if (c == '\n')
      out.emplace_back();
    else
      out.back() += c;
  return out;
}

// What a shell prints.
std::string outputOf(const Folder& folder, const std::string& command) {
  const std::string file = folder.path / "printed";
  REQUIRE(std::system(("cd '" + folder.path.string() + "' && " + command + " > " + file + " 2>&1").c_str()) == 0);
  return readText(file);
}

}  // namespace

TEST_CASE("manual: a page for every command, with every option that its help has") {
  const Folder folder;
  REQUIRE(braidRun(folder, "--documents docs").code == 0);
  const fs::path docs = folder.path / "docs";
  for (const char* command : {"render", "preview", "plan", "info", "compare", "combine", "merge", "sweep", "bench"}) {
    CAPTURE(command);
    const std::string page = readText(docs / "man" / (std::string("braid-") + command + ".1"));
    CHECK(contains(page, ".SH SYNOPSIS"));
    int options = 0;
    for (const std::string& line : lines(braidRun(folder, std::string(command) + " --help-all").out)) {
      const size_t at = line.find("--");
      if (at == std::string::npos || line.find_first_not_of(" ,-abcdefghijklmnopqrstuvwxyz") < at) continue;
      std::string name = line.substr(at, line.find_first_of(" ,=", at) - at);
      if (name.size() < 4) continue;
      std::string escaped;
      for (const char c : name) escaped += c == '-' ? "\\-" : std::string(1, c);
      CHECK_MESSAGE(contains(page, escaped), name);
      ++options;
    }
    CHECK(options > 2);
    // Of text, no line is a command.
    for (const std::string& line : lines(page))
      if (!line.empty() && line[0] == '.') CHECK_MESSAGE(contains(".TH .SH .SS .TP .nf .fi", line.substr(0, 3)), line);
  }
  CHECK(contains(readText(docs / "man" / "braid.1"), "braid\\-render"));
}

TEST_CASE("completion: commands, options and names in bash") {
  const Folder folder;
  REQUIRE(braidRun(folder, "--documents docs").code == 0);
  const auto completed = [&](const std::string& words, int at) {
    return outputOf(folder, "bash -c '. docs/bash/braid; COMP_WORDS=(" + words + "); COMP_CWORD=" + std::to_string(at) +
                                "; _braid; echo ${COMPREPLY[@]}'");
  };
  CHECK(completed("braid ren", 1) == "render\n");
  CHECK(completed("braid render --integ", 2) == "--integrator\n");
  CHECK(completed("braid render --integrator bd", 3) == "bdpt\n");
  CHECK(contains(completed("braid combine --method ", 3), "auto"));
  CHECK(completed("braid render scenes/cor", 2) == "\n");  // files are the shell's
}

TEST_CASE("manual: what cannot be written is told") {
  const Folder folder;
  const Run run = braidRun(folder, "--documents /proc/none");
  CHECK(run.code == 3);
  CHECK(contains(run.err, "/proc/none"));
}

}  // namespace braid::test_manual
