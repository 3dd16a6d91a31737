// SPDX-License-Identifier: Apache-2.0
// The layers of the architecture hold: files include what the table of folders in README.md allows, and nothing else.
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>

#include <doctest/doctest.h>

namespace braid::test_layers {

namespace {

namespace fs = std::filesystem;

// The folders that each folder may include besides itself, as the table under "## Folders" in README.md has them.
using Layers = std::map<std::string, std::set<std::string>>;

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" `"), last = text.find_last_not_of(" `");
  return first == std::string::npos ? std::string() : text.substr(first, last - first + 1);
}

// "film" in the row of renderer/scene is renderer/film; what is no folder there is a path from the top.
std::string resolved(const std::string& name, const std::string& row) {
  const std::string beside = row.substr(0, row.find('/')) + "/" + name;
  return fs::is_directory(fs::path(BRAID_SOURCE_DIR) / beside) ? beside : name;
}

Layers readLayers(std::istream& readme) {
  Layers layers;
  std::string line;
  while (std::getline(readme, line) && line != "## Folders") {
  }
  while (std::getline(readme, line) && !line.starts_with("## ")) {
    if (!line.starts_with("| `")) continue;
    std::istringstream cells(line.substr(1));
    std::string folder, holds, include;
    std::getline(cells, folder, '|');
    std::getline(cells, holds, '|');
    std::getline(cells, include, '|');
    std::istringstream names(include);
    std::set<std::string>& below = layers[trimmed(folder)];
    for (std::string name; names >> name;) below.insert(resolved(trimmed(name), trimmed(folder)));
  }
  return layers;
}

const Layers& layers() {
  static const Layers table = [] {
    std::ifstream readme(fs::path(BRAID_SOURCE_DIR) / "README.md");
    return readLayers(readme);
  }();
  return table;
}

std::string folderOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? std::string() : path.substr(0, slash);
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

// Tools may include every folder of the boxes in their row; all others name each folder.
bool allowed(const std::string& file, const std::string& include) {
  const std::string to = folderOf(include);
  for (std::string from = folderOf(file); !from.empty(); from = folderOf(from)) {
    const auto row = layers().find(from);
    if (from == folderOf(file) && from == to) return true;
    if (row == layers().end()) continue;
    if (row->second.count(to) > 0) return true;
    if (from == "tools" && to != "tools" && row->second.count(to.substr(0, to.find('/'))) > 0) return true;
  }
  return false;
}

bool reaches(const std::string& from, const std::string& to, std::set<std::string>& seen) {
  if (from != "tools" && seen.insert(from).second)
    for (const std::string& next : layers().at(from))
      if (next == to || (layers().count(next) > 0 && reaches(next, to, seen))) return true;
  return false;
}

}  // namespace

TEST_CASE("No source file includes what the table of folders does not allow it") {
  const fs::path root = BRAID_SOURCE_DIR;
  std::set<std::string> seen;
  for (const char* top : {"braid", "renderer", "integrators", "combiners", "tools"})
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string file = fs::relative(entry.path(), root).generic_string(), kind = entry.path().extension();
      if (kind != ".h" && kind != ".cpp" && kind != ".def") continue;
      REQUIRE_MESSAGE(layers().count(folderOf(file)) > 0, file, " lies in a folder without a row in README.md");
      seen.insert(folderOf(file));
      std::ifstream in(entry.path());
      std::string line;
      while (std::getline(in, line)) {
        const std::string include = included(line);
        if (include.find('/') != std::string::npos)
          CHECK_MESSAGE(allowed(file, include), file, " must not include ", include);
      }
    }
  CHECK(seen.size() >= 40);
}

TEST_CASE("Folders depend on each other in one direction only") {
  for (const auto& [folder, below] : layers()) {
    std::set<std::string> seen;
    CHECK_MESSAGE(!reaches(folder, folder, seen), folder, " depends on itself");
  }
}

TEST_CASE("The check of the layers sees a wrong include") {
  CHECK(included("#include \"tools/options/cli.h\"  // because") == "tools/options/cli.h");
  CHECK(included("  #  include \"a.h\"") == "a.h");
  CHECK(included("#include <vector>").empty());
  CHECK(included("// #include \"a.h\"").empty());
  CHECK(allowed("renderer/scene/scene.h", "renderer/core/vec.h"));
  CHECK(allowed("tools/commands/render.cpp", "renderer/film/files/exr.h"));
  CHECK_FALSE(allowed("renderer/film/film.h", "renderer/scene/scene.h"));
  CHECK_FALSE(allowed("renderer/film/film.h", "renderer/film/files/exr.h"));
  CHECK_FALSE(allowed("renderer/core/vec.h", "integrators/registry.h"));
  CHECK_FALSE(allowed("combiners/auto/auto.cpp", "renderer/session/session.h"));
  CHECK_FALSE(allowed("combiners/statistics/variance.h", "combiners/auto/refilter.h"));
  CHECK_FALSE(allowed("integrators/pt.cpp", "tools/options/cli.h"));
  CHECK_FALSE(allowed("tools/options/cli.h", "tools/commands/lists.h"));
}

}  // namespace braid::test_layers
