// SPDX-License-Identifier: Apache-2.0
// What is wrong with a file, where, how to mend it and what stands in meanwhile; and which parts of the file the
// picture uses, since a flaw in anything else is no more than a note.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "renderer/core/error.h"

namespace braid::gltf {

// The objects of a file that the chosen scene, pose and cameras read, by array ("meshes") and index.
class Usage {
 public:
  // Image-based lights have an array of that name. Returns whether it is marked for the first time. Negative indices
  // are no objects.
  bool mark(const std::string& array, int index);
  // Whether the object that a JSON pointer leads into is used; places outside of arrays of objects always are.
  bool covers(const std::string& place) const;

 private:
  std::map<std::string, std::vector<bool>, std::less<>> used_;
};

// Collects problems (against the specification: --strict refuses the file) and warnings (legal, or never refused). Not
// thread-safe: parallel work fills one report per item and appends them in order.
class Report {
 public:
  // `text` says what is wrong and how to mend it, `meanwhile` what the picture does without.
  void problem(const std::string& place, const std::string& text, const std::string& meanwhile);
  void warn(const std::string& place, const std::string& text, uint64_t count = 1);
  void append(const Report& other);

  size_t problemCount() const { return problemCount_; }
  // Throws SceneError with every problem, or with those of used things, if there is any.
  void throwIfBroken(const std::string& file, const Usage* usage = nullptr) const;

  // One line a kind of flaw in what is used, or in what is not: place of the first, text, count.
  std::vector<std::string> lines(const Usage& usage, bool used) const;

 private:
  struct Flaw {
    std::string place, text, meanwhile;
    uint64_t count = 1;
    bool isProblem = false;
  };
  void add(Flaw flaw);

  std::vector<Flaw> flaws_;
  std::map<std::pair<std::string, std::string>, size_t> index_;  // place and text to the flaw
  size_t problemCount_ = 0;
};

// "1 vertex", "2 vertices": counts in messages.
std::string counted(uint64_t count, const char* one, const char* many);
// Shortens and quotes text of unknown origin so that a message stays on one line.
std::string quoted(const std::string& text);

}  // namespace braid::gltf
