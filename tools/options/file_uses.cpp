// SPDX-License-Identifier: Apache-2.0
#include "tools/options/file_uses.h"

#include <algorithm>
#include <filesystem>

#include <sys/stat.h>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/output_file.h"
#include "tools/options/scene_files.h"

namespace braid {

namespace {

bool isStandardOutput(const std::string& path) {
  return path == kStandardOutput || path == "/dev/stdout" || path == "/dev/fd/1" || path == "/proc/self/fd/1";
}

bool takesAnything(const std::string& path) {
  struct stat status {};
  return !isStandardOutput(path) && ::stat(path.c_str(), &status) == 0 && S_ISCHR(status.st_mode);
}

bool exists(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

std::string shown(const std::string& path) { return path == kStandardOutput ? "standard output" : path; }

}  // namespace

bool isSameFile(const std::string& a, const std::string& b) {
  if (isStandardOutput(a) || isStandardOutput(b)) return isStandardOutput(a) && isStandardOutput(b);
  struct stat x {
  }, y{};
  const bool hasA = ::stat(a.c_str(), &x) == 0, hasB = ::stat(b.c_str(), &y) == 0;
  if (hasA && hasB) return x.st_dev == y.st_dev && x.st_ino == y.st_ino;
  if (hasA || hasB) return false;
  std::error_code ignored;
  const auto place = [&](const std::string& path) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(behindLinks(path), ignored), ignored);
  };
  return place(a) == place(b);
}

bool isWithin(const std::string& file, const std::string& folder) {
  std::error_code ignored;
  const std::filesystem::path inner =
                                  std::filesystem::weakly_canonical(std::filesystem::absolute(file, ignored), ignored),
                              outer = std::filesystem::weakly_canonical(std::filesystem::absolute(folder, ignored),
                                                                        ignored);
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

void FileUses::output(const std::string& what, const std::string& path) {
  if (!path.empty() && !takesAnything(path)) outputs_.push_back({what, path});
}

void FileUses::input(const std::string& what, const std::string& path) {
  if (!path.empty()) inputs_.push_back({what, path});
}

void FileUses::scene(const std::string& file, const std::string& environment) {
  input("the scene", file);
  input("the environment", environment);
  scenes_.push_back({"a file of the scene", file});
}

void FileUses::method(const std::string& name) {
  const std::string kind = "external:";
  for (size_t at = name.find(kind); at != std::string::npos; at = name.find(kind, at)) {
    at += kind.size();
    const size_t end = std::min(name.find('@', at), name.size());
    while (at < end) {
      const size_t next = std::min(name.find_first_of(":+", at), end);
      input("an image of " + kind, name.substr(at, next - at));
      at = next + 1;
    }
    at = end;
  }
}

void FileUses::check() const {
  std::vector<Use> others = inputs_;
  // Only what exists can be a file that a scene is read from.
  if (std::any_of(outputs_.begin(), outputs_.end(), [](const Use& o) { return exists(o.path); }))
    for (const Use& scene : scenes_)
      for (const std::string& file : filesOfScene(scene.path)) others.push_back({scene.what, file});
  for (const Use& o : outputs_) {
    for (const Use& other : others)
      if (isSameFile(o.path, other.path))
        throw Error(ExitCode::Usage, fmt::format("{} {}: is {}, {}, which would be lost: give another name", o.what,
                                                 shown(o.path), other.what, shown(other.path)));
    others.push_back(o);
  }
}

}  // namespace braid
