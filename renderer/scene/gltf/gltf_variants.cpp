// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/gltf_variants.h"

#include <algorithm>

namespace braid::gltf {

int chosenVariant(const Document& document, const std::string& name) {
  if (name.empty()) return -1;
  const auto found = std::find(document.variants.begin(), document.variants.end(), name);
  if (found != document.variants.end()) return static_cast<int>(found - document.variants.begin());
  std::string names;
  for (const std::string& known : document.variants) names += (names.empty() ? "" : ", ") + quoted(known);
  throw SceneError(ExitCode::BadInput, document.path, "/extensions/KHR_materials_variants/variants",
                   "variant " + quoted(name) + " does not exist; " +
                       (names.empty() ? "the file has no variants" : "the file has " + names));
}

std::vector<std::pair<int, int>> variantsOf(const Primitive& primitive) {
  std::vector<std::pair<int, int>> variants;
  const Value& mappings = member(member(primitive.extensions, "KHR_materials_variants"), "mappings");
  for (size_t i = 0; i < mappings.ArrayLen(); ++i) {
    const Value& mapping = mappings.Get(static_cast<int>(i));
    const Value& list = member(mapping, "variants");
    if (index(mapping, "material") < 0) continue;  // reported with the JSON
    for (size_t k = 0; k < list.ArrayLen(); ++k)
      variants.emplace_back(list.Get(static_cast<int>(k)).GetNumberAsInt(), index(mapping, "material"));
  }
  return variants;
}

}  // namespace braid::gltf
