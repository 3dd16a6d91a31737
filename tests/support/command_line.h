// SPDX-License-Identifier: Apache-2.0
// Runs the braid binary as its users do.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <sys/wait.h>

#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test {

struct Run {
  int code = -1;
  std::string out, err;
};

inline std::string readText(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The options with the plain path-traced image and all layers, but for what they say themselves: for tests of what
// files hold and of what does not depend on combining.
inline std::string plainly(const std::string& options) {
  std::string all = options;
  for (const std::string plain : {"--integrator pt", "--combine none", "--aovs all"})
    if (options.find(plain.substr(0, plain.find(' '))) == std::string::npos) all += " " + plain;
  return all;
}

// Runs braid in the folder through the shell; `before` may set limits.
inline Run braidRun(const Folder& folder, const std::string& arguments, const std::string& before = "") {
  const std::string out = folder.path / "stdout", err = folder.path / "stderr";
  const std::string command = before + "'" BRAID_BINARY "' " + arguments + " >'" + out + "' 2>'" + err + "'";
  const int status = std::system(("cd '" + folder.path.string() + "' && " + command).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, readText(out), readText(err)};
}

}  // namespace braid::test
