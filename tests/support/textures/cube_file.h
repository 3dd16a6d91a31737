// SPDX-License-Identifier: Apache-2.0
// Files with an image-based light (EXT_lights_image_based).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tests/support/gltf_fixture.h"
#include "tests/support/textures/png_writer.h"

namespace braid::test {

inline constexpr const char* kImageBased = "EXT_lights_image_based";
// RGBA of a pixel.
using FaceColour = std::function<std::vector<uint8_t>(size_t face, int x, int y)>;

// A square that sees one half of the surroundings, a light, and images of `size` pixels for its faces.
inline GltfFile cubeFile(int size, const FaceColour& colour) {
  GltfFile file = quadFile();
  Json faces = Json::array();
  for (size_t face = 0; face < 6; ++face) {
    std::vector<uint8_t> pixels;
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        for (const uint8_t b : colour(face, x, y)) pixels.push_back(b);
    const std::vector<uint8_t> png = pngOf(static_cast<uint32_t>(size), static_cast<uint32_t>(size), pixels);
    faces.push_back(file.append("images", {{"bufferView", file.view(png)}, {"mimeType", "image/png"}}));
  }
  file.root["extensionsUsed"] = {kImageBased};
  file.root["extensions"][kImageBased]["lights"] = {
      {{"intensity", 1}, {"specularImageSize", size}, {"specularImages", {faces}}}};
  file.root["scenes"][0]["extensions"][kImageBased]["light"] = 0;
  return file;
}

}  // namespace braid::test
