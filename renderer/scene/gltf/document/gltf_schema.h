// SPDX-License-Identifier: Apache-2.0
// The part of glTF that braid reads, as a table: which members an object may have, of what type and range, what their
// indices point at, and what stands in for those that are missing or wrong.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include <nlohmann/json_fwd.hpp>

#include "renderer/scene/gltf/document/gltf_report.h"

namespace braid::gltf {

enum class Kind : uint8_t {
  Bool,
  Text,
  Texts,
  Word,
  Real,
  Reals,
  RealRows,  // arrays of numbers; a row that is wrong becomes empty
  Colour,
  Whole,
  Index,
  Indices,
  IndexRows,  // arrays of indices, -1 for one that points at nothing; a row of another length becomes empty
  Map,
  Object,
  List
};

struct Field {
  const char* name;
  Kind kind;
  // Index, Indices, IndexRows, Map: the array that is pointed at. Word: the words, separated by ", ". Whole: the
  // numbers that are allowed, if not all.
  const char* of = nullptr;
  // Real, Colour: values outside are clamped with a warning. Whole: those above are problems.
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
  size_t count = 0;                   // Reals, and of a row: how many, 0: any number
  std::span<const Field> shape = {};  // of an Object, or of each entry of a List
  const char* mend = nullptr;         // a required member: what to write
  // JSON in place of a required member that is missing or wrong; none: the object is left out.
  const char* fallback = nullptr;
  const char* ifWrong = nullptr;  // JSON in place of an optional member that is wrong
  const char* meanwhile = nullptr;
};

// The root object of a file.
std::span<const Field> rootShape();
// The extensions of materials, all of them rendered.
std::span<const Field> materialExtensions();

// Makes the JSON one that holds nothing but what the table allows, each deviation reported with its pointer: unknown
// members are dropped, wrong ones are taken as absent or replaced as the table says, whole numbers become integers.
// What tinygltf reads afterwards has no wrong type and no index out of range (-1 or -2: none).
void checkJson(nlohmann::json& root, Report& report);

}  // namespace braid::gltf
