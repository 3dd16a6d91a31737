// SPDX-License-Identifier: Apache-2.0
// The images of a file's textures, decoded once each.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "renderer/scene/gltf/document/gltf_document.h"

namespace braid::gltf {

// The images that a texture names in formats that are supported: KTX2, then AVIF, then WebP, then any other, each if it
// is there. The first that can be decoded is read.
std::vector<int> imagesOf(const tinygltf::Texture& texture);

class PixelBudget;

class ImageTable {
 public:
  // The textures of the file that are read; their images are decoded in parallel.
  ImageTable(Document& document, const std::set<int>& textures);

  // Null where a texture has no image that can be decoded: its factor stays alone.
  const DecodedImage* of(int texture) const;

  // Images that no texture needs, decoded in parallel; null where one cannot be, which is reported with `meanwhile`.
  std::vector<std::shared_ptr<const Image>> read(const std::vector<int>& images, const char* meanwhile);

 private:
  using Key = std::pair<std::string_view, int>;  // two entries for one file or view share its pixels

  Key key(int image) const;
  const DecodedImage& at(int image) const { return document_.decoded[static_cast<size_t>(first_.at(key(image)))]; }
  // Those that no other entry of the same pixels was decoded for.
  std::vector<int> decode(const std::map<int, bool>& images, PixelBudget& budget);
  void report(int image, const char* meanwhile);

  Document& document_;
  std::map<Key, int> first_;
};

}  // namespace braid::gltf
