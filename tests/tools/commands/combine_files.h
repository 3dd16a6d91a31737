// SPDX-License-Identifier: Apache-2.0
// Combines files by the real binary.
#pragma once

#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include "tests/support/command_line.h"

namespace braid::test::combine_files {

inline Run combined(const Folder& folder, const std::string& rest) {
  const Run run = braidRun(folder, "combine -q --float " + rest);
  INFO(run.err);
  REQUIRE(run.code == 0);
  return run;
}

// An EXR with any channels, each filled with its own values: channel c of pixel i is base + c + i / 1000.
inline void writeChannels(const std::string& path, const std::vector<std::string>& names, float base = 1,
                          int samples = 0, const char* cyclesSamples = nullptr) {
  const int width = 12, height = 10;
  OIIO::ImageSpec spec(width, height, static_cast<int>(names.size()), OIIO::TypeDesc::FLOAT);
  spec.channelnames = names;
  if (samples > 0) spec.attribute("samplesPerPixel", samples);
  if (cyclesSamples) spec.attribute("cycles.ViewLayer.samples", cyclesSamples);
  std::vector<float> data;
  for (int i = 0; i < width * height; ++i)
    for (size_t c = 0; c < names.size(); ++c)
      data.push_back(base + static_cast<float>(c) + static_cast<float>(i) / 1000);
  const auto out = OIIO::ImageOutput::create(path);
  REQUIRE(out);
  REQUIRE(out->open(path, spec));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, data.data()));
  REQUIRE(out->close());
}

}  // namespace braid::test::combine_files
