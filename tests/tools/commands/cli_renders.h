// SPDX-License-Identifier: Apache-2.0
// Renders by the real binary, and what its files and logs hold.
#pragma once

#include <string>

#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"

namespace braid::test::cli_renders {

inline const std::string kCornell = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb'";

inline std::string renderCommand(const std::string& rest, const std::string& scene = kCornell) {
  const auto unless = [&](const char* option, const char* value) {
    return rest.find(option) == std::string::npos ? std::string(" ") + option + value : std::string();
  };
  return "render " + scene + " -q" + unless("--size", " 24x16") + unless("--spp", " 2") + unless("-o ", " out.exr") +
         " " + test::plainly(rest);
}

inline ImageFile rendered(const Folder& folder, const std::string& rest, const std::string& scene = kCornell) {
  const Run run = braidRun(folder, renderCommand(rest, scene));
  INFO(run.err);
  REQUIRE(run.code == 0);
  CHECK(run.err.empty());
  return readImage(folder.path / "out.exr");
}

inline const Attribute* attribute(const ImageFile& file, const std::string& name) {
  for (const Attribute& a : file.attributes)
    if (a.name == name) return &a;
  return nullptr;
}

}  // namespace braid::test::cli_renders
