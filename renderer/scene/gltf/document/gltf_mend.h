// SPDX-License-Identifier: Apache-2.0
// What is changed in a file's text before tinygltf reads it, since the parser or tinygltf would refuse the whole file.
#pragma once

#include <span>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "renderer/scene/gltf/document/gltf_report.h"

namespace braid::gltf {

// JSON that a strict parser refuses, with its small flaws repaired. Anything else stays as it is.
std::string mendText(std::span<const uint8_t> json, Report& report);

// The checked JSON, changed where tinygltf 2.7 would refuse it.
void mendJson(nlohmann::json& root, Report& report);

}  // namespace braid::gltf
