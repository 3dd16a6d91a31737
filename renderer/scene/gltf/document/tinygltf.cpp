// SPDX-License-Identifier: Apache-2.0
// The functions of tinygltf, compiled here: Debian's libdraco exports those of another version under the same names, so
// that with the shared library it would depend on the order of linking which are called.
#include <fstream>

#include "renderer/scene/gltf/document/gltf_document.h"

#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>
#undef TINYGLTF_IMPLEMENTATION  // other files may follow in a unity build

namespace braid::gltf {

void parseNode(const nlohmann::json& json, tinygltf::Node& node) {
  // It refuses nothing: members of a wrong type would count as absent.
  tinygltf::ParseNode(&node, nullptr, json, false);
}

void parseMaterial(const nlohmann::json& json, tinygltf::Material& material) {
  tinygltf::ParseMaterial(&material, nullptr, json, false);
}

void parseCamera(const nlohmann::json& json, tinygltf::Camera& camera) {
  tinygltf::ParseCamera(&camera, nullptr, json, false);
}

void parseLight(const nlohmann::json& json, tinygltf::Light& light) {
  tinygltf::ParseLight(&light, nullptr, json, false);
}

}  // namespace braid::gltf
