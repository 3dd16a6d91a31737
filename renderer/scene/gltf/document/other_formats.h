// SPDX-License-Identifier: Apache-2.0
// What a file is that is no glTF, by how it begins: people hand a renderer what they have.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace braid::gltf {

// "is a file of Blender; export glTF 2.0 (.glb) from it", say: what the bytes are and what helps, for the formats of
// scenes, archives and images that `other_formats.cpp` lists. Empty: none of them.
std::string otherFormat(std::span<const uint8_t> bytes);

// The same for what stands in the place of any file: pointers of Git LFS, and pages of servers.
std::string noFileAtAll(std::span<const uint8_t> bytes);

// Whether they begin as an image does.
bool isImage(std::span<const uint8_t> bytes);

}  // namespace braid::gltf
