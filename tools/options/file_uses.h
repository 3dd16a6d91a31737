// SPDX-License-Identifier: Apache-2.0
// What a command reads and writes: nothing may be written over what it reads, nor two things into one file.
#pragma once

#include <string>
#include <vector>

namespace braid {

class FileUses {
 public:
  // `what` names them for people, such as "--png". Empty paths do not count; devices take anything.
  void output(const std::string& what, const std::string& path);
  void input(const std::string& what, const std::string& path);
  // The scene with the files that it names, and its environment if there is one.
  void scene(const std::string& file, const std::string& environment);
  // The files that a method's name reads: external:FILE, also within bases and after '@'.
  void method(const std::string& name);

  // Throws Error(Usage) naming both, where an output is an input or another output: by device and inode, through links,
  // or, for files that do not exist yet, by their paths.
  void check() const;

 private:
  struct Use {
    std::string what, path;
  };
  std::vector<Use> outputs_, inputs_;
  std::vector<Use> scenes_;  // not yet looked into
};

// Whether both are one file, or would be.
bool isSameFile(const std::string& a, const std::string& b);
// Whether the file lies below the folder, links followed.
bool isWithin(const std::string& file, const std::string& folder);

}  // namespace braid
