// SPDX-License-Identifier: Apache-2.0
// Loads flawed glTF files and checks what is said of their flaws.
#pragma once

#include <string>

#include "tests/support/contains.h"
#include "tests/support/gltf_fixture.h"

namespace braid::test::gltf_lenient {

inline bool hasNote(const SceneData& scene, const std::string& part) {
  for (const std::string& note : scene.notes) {
    if (contains(note, part)) return true;
  }
  return false;
}

// Loads, checks the warning, and that --strict refuses the same file.
inline SceneData loadWarned(const GltfFile& file, const std::string& warning, LoadOptions options = {}) {
  const SceneData scene = file.load(options);
  std::string all;
  for (const std::string& line : scene.warnings) all += line + '\n';
  INFO("warnings: ", all);
  CHECK(hasWarning(scene, warning));
  CHECK(!errorOf(file, options).empty());
  return scene;
}

}  // namespace braid::test::gltf_lenient
