// SPDX-License-Identifier: Apache-2.0
// The layers of the architecture hold: no file includes one of a box above it or beside it.
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

namespace braid::test_layers {

namespace {

namespace fs = std::filesystem;

// What each box may include besides itself. Tools and tests may include everything.
const std::map<std::string, std::set<std::string>> kBoxes = {
    {"renderer/core", {}},
    {"renderer/film", {"renderer/core"}},
    {"renderer/scene", {"renderer/core"}},
    {"renderer/transport", {"renderer/core", "renderer/scene"}},
    {"renderer/session", {"renderer/core", "renderer/film", "renderer/scene", "renderer/transport"}},
    {"integrators", {"renderer/core", "renderer/film", "renderer/scene", "renderer/transport", "renderer/session"}},
    {"combiners", {"renderer/core", "renderer/film"}},
};

// The box that a path relative to the source folder lies in; empty: none.
std::string boxOf(const std::string& path) {
  for (const auto& [box, below] : kBoxes)
    if (path.rfind(box + "/", 0) == 0) return box;
  return {};
}

// The quoted file of an #include line, or nothing.
std::string included(const std::string& line) {
  const size_t hash = line.find_first_not_of(" \t");
  if (hash == std::string::npos || line[hash] != '#') return {};
  const size_t word = line.find_first_not_of(" \t", hash + 1);
  if (word == std::string::npos || line.compare(word, 7, "include") != 0) return {};
  const size_t open = line.find('"', word), close = line.find('"', open + 1);
  return open == std::string::npos || close == std::string::npos ? "" : line.substr(open + 1, close - open - 1);
}

bool allowed(const std::string& file, const std::string& include) {
  const std::string from = boxOf(file), to = boxOf(include);
  return from == to || (!to.empty() && kBoxes.at(from).count(to) > 0);
}

}  // namespace

TEST_CASE("No source file includes a box above or beside its own") {
  const fs::path root = BRAID_SOURCE_DIR;
  std::set<std::string> seen;
  for (const char* top : {"renderer", "integrators", "combiners"}) {
    if (!fs::exists(root / top)) continue;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string file = fs::relative(entry.path(), root).generic_string(), kind = entry.path().extension();
      if (kind != ".h" && kind != ".cpp" && kind != ".def") continue;
      REQUIRE_MESSAGE(!boxOf(file).empty(), file, " lies in no box: add its folder to the table above");
      seen.insert(boxOf(file));
      std::ifstream in(entry.path());
      std::string line;
      while (std::getline(in, line)) {
        const std::string include = included(line);
        if (!include.empty()) CHECK_MESSAGE(allowed(file, include), file, " must not include ", include);
      }
    }
  }
  CHECK(seen.size() >= 6);
}

TEST_CASE("The check of the layers sees a wrong include") {
  CHECK(included("#include \"tools/cli.h\"  // because") == "tools/cli.h");
  CHECK(included("  #  include \"a.h\"") == "a.h");
  CHECK(included("#include <vector>").empty());
  CHECK(included("// #include \"a.h\"").empty());
  CHECK(allowed("renderer/scene/scene.h", "renderer/core/vec.h"));
  CHECK_FALSE(allowed("renderer/film/film.h", "renderer/scene/scene.h"));
  CHECK_FALSE(allowed("renderer/core/vec.h", "integrators/registry.h"));
  CHECK_FALSE(allowed("combiners/auto.cpp", "renderer/session/session.h"));
  CHECK_FALSE(allowed("integrators/pt.cpp", "tools/cli.h"));
}

}  // namespace braid::test_layers
