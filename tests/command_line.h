// SPDX-License-Identifier: Apache-2.0
// Runs the braid binary as its users do.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <sys/wait.h>

#include "tests/contains.h"
#include "tests/gltf_fixture.h"

namespace braid::test {

struct Run {
  int code = -1;
  std::string out, err;
};

inline std::string readText(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Runs braid in the folder through the shell; `before` may set limits.
inline Run braidRun(const Folder& folder, const std::string& arguments, const std::string& before = "") {
  const std::string out = folder.path / "stdout", err = folder.path / "stderr";
  const std::string command = before + "'" BRAID_BINARY "' " + arguments + " >'" + out + "' 2>'" + err + "'";
  const int status = std::system(("cd '" + folder.path.string() + "' && " + command).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, readText(out), readText(err)};
}

}  // namespace braid::test
