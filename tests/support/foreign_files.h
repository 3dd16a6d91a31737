// SPDX-License-Identifier: Apache-2.0
// Image files as other renderers write them: channels by their names, written by OpenImageIO.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include "renderer/core/plane.h"

namespace braid::test {

struct ForeignChannels {
  std::vector<std::string> names;
  std::vector<const Plane<float>*> planes;

  void add(const std::string& name, const Plane<float>& plane) {
    names.push_back(name);
    planes.push_back(&plane);
  }
  void add(const std::string& layer, const char* components, const Rgb<float>& image) {
    for (size_t c = 0; c < 3; ++c)
      add(layer.empty() ? std::string(1, components[c]) : layer + "." + components[c], image[c]);
  }
};

// An EXR of 32-bit floats with these attributes of text, and the number of samples as pbrt writes it (0: none).
inline void writeForeign(const std::string& path, const ForeignChannels& channels, int samplesPerPixel = 0,
                         const std::vector<std::pair<std::string, std::string>>& attributes = {}) {
  const Plane<float>& first = *channels.planes.at(0);
  const size_t count = channels.names.size();
  OIIO::ImageSpec spec(first.width, first.height, static_cast<int>(count), OIIO::TypeDesc::FLOAT);
  spec.channelnames = channels.names;
  if (samplesPerPixel > 0) spec.attribute("samplesPerPixel", samplesPerPixel);
  for (const auto& [name, text] : attributes) spec.attribute(name, text);
  std::vector<float> data(first.size() * count);
  for (size_t i = 0; i < first.size(); ++i)
    for (size_t c = 0; c < count; ++c) data[i * count + c] = (*channels.planes[c])[i];
  const auto out = OIIO::ImageOutput::create(path);
  REQUIRE(out);
  REQUIRE(out->open(path, spec));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, data.data()));
  REQUIRE(out->close());
}

}  // namespace braid::test
