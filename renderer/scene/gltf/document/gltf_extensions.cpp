// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_extensions.h"

#include <algorithm>
#include <array>

#include <nlohmann/json.hpp>

#include "renderer/scene/gltf/document/gltf_schema.h"

namespace braid::gltf {

namespace {

// Beside those of materials, which gltf_schema.cpp lists.
constexpr std::array kRendered = {
    "EXT_lights_image_based", "EXT_mesh_gpu_instancing", "EXT_meshopt_compression",    "EXT_texture_avif",
    "EXT_texture_webp",       "KHR_animation_pointer",   "KHR_draco_mesh_compression", "KHR_lights_punctual",
    "KHR_materials_variants", "KHR_mesh_quantization",   "KHR_meshopt_compression",    "KHR_node_visibility",
    "KHR_texture_basisu",     "KHR_texture_transform",
};

// No pixel depends on them: metadata, feature ids, outlines, levels of detail beside the finest, interaction, sound,
// physics.
constexpr std::array kHarmless = {
    "3DTILES_metadata",
    "AGI_articulations",
    "AGI_stk_metadata",
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_property_attributes",
    "EXT_property_table",
    "EXT_property_texture",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "GODOT_single_root",
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_collision_shapes",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_audio_emitter",
    "MSFT_collision_mesh",
    "MSFT_lod",
    "MSFT_physics",
    "OMI_audio_emitter",
    "OMI_collider",
    "OMI_link",
    "OMI_personality",
    "OMI_physics_body",
    "OMI_physics_gravity",
    "OMI_physics_joint",
    "OMI_physics_shape",
    "OMI_seat",
    "OMI_spawn_point",
    "OMI_vehicle_body",
    "OMI_vehicle_hover_thruster",
    "OMI_vehicle_thruster",
    "OMI_vehicle_wheel",
};

template <class List>
bool isIn(const List& list, const std::string& name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

bool isSupported(const std::string& name) {
  const auto ofMaterials = materialExtensions();
  return isIn(kRendered, name) || isIn(kHarmless, name) || name.empty() ||
         std::any_of(ofMaterials.begin(), ofMaterials.end(), [&](const Field& f) { return f.name == name; });
}

std::vector<std::string> names(const nlohmann::json& root, const char* list) {
  const auto found = root.find(list);
  return found == root.end() ? std::vector<std::string>() : found->get<std::vector<std::string>>();
}

}  // namespace

void checkExtensions(Document& document, const nlohmann::json& root) {
  std::vector<Problem> unsupported;
  const std::vector<std::string> required = names(root, "extensionsRequired");
  for (size_t i = 0; i < required.size(); ++i) {
    const std::string& name = required[i];
    const std::string place = "/extensionsRequired/" + std::to_string(i);
    if (isSupported(name)) continue;
    if (isIn(document.options.ignoredExtensions, name)) {
      document.report.warn(place, "extension " + quoted(name) + " is required but ignored, as --ignore-extension says");
      continue;
    }
    unsupported.push_back({place, "extension " + quoted(name) +
                                      " is not supported; export the file without it, or give --ignore-extension " +
                                      name});
  }
  if (!unsupported.empty()) throw SceneError(ExitCode::UnsupportedExtension, document.path, std::move(unsupported));
  std::string ignored;
  for (const std::string& name : names(root, "extensionsUsed")) {
    if (isSupported(name)) continue;
    document.extensionsIgnored.push_back(name);
    ignored += (ignored.empty() ? "" : ", ") + quoted(name);
  }
  if (!ignored.empty())
    document.report.warn("/extensionsUsed", "extensions that are not supported are ignored: " + ignored);
}

}  // namespace braid::gltf
