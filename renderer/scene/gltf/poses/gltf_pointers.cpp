// SPDX-License-Identifier: Apache-2.0
// KHR_animation_pointer: values are written into the checked JSON of what they belong to, which is then read again.
#include <algorithm>
#include <set>

#include <nlohmann/json.hpp>

#include "renderer/scene/gltf/document/gltf_schema.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"

namespace braid::gltf {

namespace {

using Json = nlohmann::json;
using Tokens = std::vector<std::string>;

// Of a JSON pointer (RFC 6901); none if it is none.
Tokens tokensOf(const std::string& pointer) {
  Tokens tokens;
  if (!pointer.starts_with('/')) return tokens;
  for (size_t i = 0; i < pointer.size(); ++i) {
    if (pointer[i] == '/') {
      tokens.emplace_back();
    } else if (!tokens.empty()) {
      const bool escaped = pointer[i] == '~' && i + 1 < pointer.size();
      tokens.back() += escaped ? (pointer[++i] == '1' ? '/' : '~') : pointer[i];
    }
  }
  return tokens;
}

int indexOf(const std::string& token, size_t size) {
  if (token.empty() || token.size() > 9 || (token.size() > 1 && token[0] == '0')) return -1;
  if (token.find_first_not_of("0123456789") != std::string::npos) return -1;
  const int index = std::stoi(token);
  return static_cast<size_t>(index) < size ? index : -1;
}

// The number, or the numbers, that a pointer leads to, by the table of what glTF allows; null: nothing of the kind, or
// the object that it would be in is not there.
const Field* numbersAt(const Json& root, const Tokens& tokens) {
  const Json* at = &root;
  std::span<const Field> shape = rootShape();
  bool inList = false;
  for (size_t i = 0; i < tokens.size(); ++i) {
    if (inList) {
      const int index = indexOf(tokens[i], at->size());
      if (index < 0) return nullptr;
      at = &(*at)[static_cast<size_t>(index)];
      inList = false;
      continue;
    }
    const auto field = std::find_if(shape.begin(), shape.end(), [&](const Field& f) { return tokens[i] == f.name; });
    if (field == shape.end()) return nullptr;
    if (i + 1 == tokens.size()) {
      const bool some = field->kind == Kind::Real ||
                        ((field->kind == Kind::Reals || field->kind == Kind::Colour) && field->count > 0);
      return some ? &*field : nullptr;
    }
    const auto next = at->find(tokens[i]);
    if (next == at->end()) return nullptr;
    at = &*next;
    shape = field->shape;
    inList = field->kind == Kind::List;
  }
  return nullptr;
}

// The weights of a mesh are those of all nodes that show it and have none of their own: a channel for each. False: no
// node has them, or together they would be more channels than a file of any use has.
bool resolveMeshWeights(Document& document, std::vector<tinygltf::AnimationChannel>& channels, size_t channel, int mesh,
                        size_t& copies) {
  constexpr size_t kMostCopies = size_t(1) << 20;
  bool any = false;
  for (size_t n = 0; n < document.model.nodes.size() && copies < kMostCopies; ++n) {
    if (document.model.nodes[n].mesh != mesh || !document.model.nodes[n].weights.empty()) continue;
    tinygltf::AnimationChannel copy = channels[channel];
    copy.target_node = static_cast<int>(n);
    copy.target_path = "weights";
    if (animatedWidth(document, copy) == 0) continue;
    ++copies;
    if (any)
      channels.push_back(std::move(copy));
    else
      channels[channel] = std::move(copy);
    any = true;
  }
  return any;
}

// False: it leads to nothing that can be animated.
bool resolve(Document& document, tinygltf::AnimationChannel& channel, AnimatedProperty property) {
  const Tokens tokens = tokensOf(property.pointer);
  if (tokens.size() >= 3 && tokens[0] == "nodes") {
    const int node = indexOf(tokens[1], document.model.nodes.size());
    if (node < 0) return false;
    if (tokens.size() == 3) {
      channel.target_node = node;
      channel.target_path = tokens[2];
      return animatedWidth(document, channel) > 0;
    }
    if (Tokens(tokens.begin() + 2, tokens.end()) != Tokens{"extensions", "KHR_node_visibility", "visible"})
      return false;
    property.visibleNode = node;
  } else {
    const Field* field = document.animatable ? numbersAt(*document.animatable, tokens) : nullptr;
    if (!field) return false;
    property.width = std::max<size_t>(field->count, 1);
    property.low = field->low;
    property.high = field->high;
  }
  document.properties.push_back(std::move(property));
  return true;
}

void setVisible(tinygltf::Node& node, bool visible) {
  tinygltf::Value::Object object;
  object["visible"] = Value(visible);
  node.extensions["KHR_node_visibility"] = Value(std::move(object));
}

void write(Json& root, const AnimatedProperty& property, const std::vector<double>& value) {
  Json numbers = Json::array();
  for (const double v : value) numbers.push_back(std::clamp(v, property.low, property.high));
  root[Json::json_pointer(property.pointer)] = value.size() == 1 ? numbers[0] : numbers;
}

// Reads the materials, cameras and lights that the pointers lead into.
void readAgain(Document& document, const Json& root, const std::set<std::pair<std::string, size_t>>& changed) {
  // Flaws of the file were told when it was read.
  const Report report = document.report;
  for (const auto& [array, index] : changed) {
    if (array == "materials") {
      tinygltf::Material material;
      parseMaterial(root["materials"][index], material);
      document.materials[index] = readMaterial(document, material, index);
    } else if (array == "cameras") {
      tinygltf::Camera camera;
      parseCamera(root["cameras"][index], camera);
      document.cameras[index] = readCamera(document, camera, index);
    } else {
      tinygltf::Light light;
      parseLight(root["extensions"]["KHR_lights_punctual"]["lights"][index], light);
      document.lights[index] = readLight(document, light, index);
    }
  }
  document.report = report;
}

}  // namespace

void resolvePointers(Document& document) {
  size_t copies = 0;
  for (size_t clip = 0; clip < document.model.animations.size(); ++clip) {
    std::vector<tinygltf::AnimationChannel>& channels = document.model.animations[clip].channels;
    for (size_t c = 0; c < channels.size(); ++c) {
      if (channels[c].target_path != "pointer") continue;
      const Value& pointer = member(member(channels[c].target_extensions, "KHR_animation_pointer"), "pointer");
      AnimatedProperty property{static_cast<int>(clip), static_cast<int>(c),
                                pointer.IsString() ? pointer.Get<std::string>() : std::string()};
      const std::string place = "/animations/" + std::to_string(clip) + "/channels/" + std::to_string(c) + "/target";
      const Tokens tokens = tokensOf(property.pointer);
      const bool ofMesh = tokens.size() == 3 && tokens[0] == "meshes" && tokens[2] == "weights";
      const int mesh = ofMesh ? indexOf(tokens[1], document.model.meshes.size()) : -1;
      if (mesh >= 0 ? resolveMeshWeights(document, channels, c, mesh, copies)
                    : resolve(document, channels[c], property))
        continue;
      channels[c].target_node = -1;
      document.report.warn(place, "its pointer " + gltf::quoted(property.pointer) +
                                      " leads to nothing that braid can animate; it stays at rest");
    }
  }
}

void animateProperties(Document& document) {
  const LoadOptions& options = document.options;
  const int clip = chosenAnimation(document, options.animation);
  if (clip < 0 || (!options.frameTime && options.animation.empty()) || document.properties.empty()) return;
  const double opening = static_cast<double>(options.frameTime.value_or(0.0f));
  const auto time = static_cast<float>(opening + (options.frameTime ? options.shutter / 2 : 0));
  Json root = document.animatable ? *document.animatable : Json::object();
  std::set<std::pair<std::string, size_t>> changed;
  bool any = false;
  const std::vector<std::optional<std::vector<double>>> values = animatedValues(document, clip, time);
  for (size_t i = 0; i < values.size(); ++i) {
    const AnimatedProperty& property = document.properties[i];
    const std::optional<std::vector<double>>& value = values[i];
    if (!value) continue;
    any = true;
    document.count(FilePart::AnimatedProperties);
    if (property.visibleNode >= 0) {
      setVisible(document.model.nodes[static_cast<size_t>(property.visibleNode)], (*value)[0] != 0);
      continue;
    }
    write(root, property, *value);
    const Tokens tokens = tokensOf(property.pointer);
    const bool light = tokens[0] == "extensions";
    changed.emplace(light ? "lights" : tokens[0], std::stoul(tokens[light ? 3 : 1]));
  }
  readAgain(document, root, changed);
  if (any && options.frameTime && options.shutter > 0)
    document.report.warn("/animations/" + std::to_string(clip),
                         "materials, cameras' lenses, lights' strengths and visibility do not blur: while the shutter "
                         "is open they are as at its middle");
}

}  // namespace braid::gltf
