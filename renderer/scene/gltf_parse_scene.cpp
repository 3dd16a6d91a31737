// SPDX-License-Identifier: Apache-2.0
// JSON to structs: nodes, scenes, skins, animations, cameras and punctual lights.
#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf_document.h"

namespace braid::gltf {

namespace {

void parseTransform(Node& node, const JsonRef& json) {
  double m[16];
  if (json["matrix"].reals(m, 16)) {
    if (json["translation"] || json["rotation"] || json["scale"]) {
      json.warn("a node has both a matrix and translation, rotation or scale; the matrix is used");
    }
    // Inverses and products come out with rounding in the last row; only more than that is a projection.
    const double off = std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11]), std::abs(m[15] - 1)});
    if (!(off <= 1e-5)) json["matrix"].problem("is not affine; its last row must be 0 0 0 1");
    m[3] = m[7] = m[11] = 0;
    m[15] = 1;
    node.matrix = glm::make_mat4(m);
  }
  double t[3], s[3], r[4];
  if (json["translation"].reals(t, 3)) node.translation = glm::dvec3(t[0], t[1], t[2]);
  if (json["scale"].reals(s, 3)) node.scale = glm::dvec3(s[0], s[1], s[2]);
  if (!json["rotation"].reals(r, 4)) return;
  const glm::dquat rotation(r[3], r[0], r[1], r[2]);
  const double length = glm::length(rotation);
  if (length < 1e-6) {
    json["rotation"].warn("is zero; no rotation is used");
    return;
  }
  if (std::abs(length - 1) > 1e-2) json["rotation"].warn("a rotation is not a unit quaternion; it is normalised");
  node.rotation = rotation / length;
}

void parseNode(Document& document, Node& node, const JsonRef& json, const std::array<size_t, 3>& counts) {
  node.name = json["name"].text();
  node.children = json["children"].indices(document.nodes.size(), "nodes");
  node.mesh = json["mesh"].index(document.meshes.size(), "meshes");
  node.camera = json["camera"].index(counts[0], "cameras");
  node.skin = json["skin"].index(counts[1], "skins");
  node.light = json.extension("KHR_lights_punctual")["light"].index(counts[2], "lights");
  if (json["weights"]) node.weights = json["weights"].realList();
  node.visible = json.extension("KHR_node_visibility")["visible"].boolean(true);
  parseTransform(node, json);
  const JsonRef instancing = json.extension("EXT_mesh_gpu_instancing")["attributes"];
  for (const char* name : {"TRANSLATION", "ROTATION", "SCALE"}) {
    const uint32_t accessor = instancing[name].index(document.accessors.size(), "accessors");
    if (accessor != kNone) node.instancing.emplace(name, accessor);
  }
}

void parseScenes(Document& document, const JsonRef& root) {
  const JsonRef list = root["scenes"];
  document.scenes.resize(list.size());
  for (size_t i = 0; i < document.scenes.size(); ++i) {
    document.scenes[i].name = list.at(i)["name"].text();
    document.scenes[i].nodes = list.at(i)["nodes"].indices(document.nodes.size(), "nodes");
  }
  document.defaultScene = root["scene"].index(document.scenes.size(), "scenes");
}

void parseSkins(Document& document, const JsonRef& list) {
  document.skins.resize(list.size());
  for (size_t i = 0; i < document.skins.size(); ++i) {
    const JsonRef json = list.at(i);
    document.skins[i].joints =
        json["joints"].required("list the nodes that move the skin").indices(document.nodes.size(), "nodes");
    document.skins[i].inverseBindMatrices = json["inverseBindMatrices"].index(document.accessors.size(), "accessors");
  }
}

struct AnimationSampler {
  uint32_t input = kNone, output = kNone;
  Interpolation interpolation = Interpolation::Linear;
};

AnimationSampler parseAnimationSampler(const Document& document, const JsonRef& json) {
  AnimationSampler sampler;
  sampler.input =
      json["input"].required("write the accessor of the key times").index(document.accessors.size(), "accessors");
  sampler.output =
      json["output"].required("write the accessor of the key values").index(document.accessors.size(), "accessors");
  const std::string word = json["interpolation"].text("LINEAR");
  if (word == "STEP") {
    sampler.interpolation = Interpolation::Step;
  } else if (word == "CUBICSPLINE") {
    sampler.interpolation = Interpolation::Cubic;
  } else if (word != "LINEAR") {
    json["interpolation"].problem("is " + quoted(word) + "; it must be one of LINEAR, STEP, CUBICSPLINE");
  }
  return sampler;
}

std::optional<AnimatedPath> parsePath(const JsonRef& json) {
  const std::string word = json.required("write translation, rotation, scale or weights").text("pointer");
  if (word == "translation") return AnimatedPath::Translation;
  if (word == "rotation") return AnimatedPath::Rotation;
  if (word == "scale") return AnimatedPath::Scale;
  if (word == "weights") return AnimatedPath::Weights;
  if (word == "pointer") {
    json.warn("animations of other properties (KHR_animation_pointer) are ignored");
  } else {
    json.problem("is " + quoted(word) + "; it must be one of translation, rotation, scale, weights");
  }
  return {};
}

void parseAnimation(Document& document, Animation& animation, const JsonRef& json) {
  animation.name = json["name"].text();
  const JsonRef samplerList = json["samplers"], channelList = json["channels"];
  std::vector<AnimationSampler> samplers;
  for (size_t i = 0; i < samplerList.size(); ++i)
    samplers.push_back(parseAnimationSampler(document, samplerList.at(i)));
  for (size_t i = 0; i < channelList.size(); ++i) {
    const JsonRef channel = channelList.at(i);
    const JsonRef target = channel["target"].required("name the node and the property that move");
    const uint32_t index = channel["sampler"]
                               .required("write the index of a sampler")
                               .index(samplers.size(), "samplers of this animation");
    const uint32_t node = target["node"].index(document.nodes.size(), "nodes");
    const std::optional<AnimatedPath> path = parsePath(target["path"]);
    if (index == kNone || node == kNone || !path) continue;
    const AnimationSampler& s = samplers[index];
    if (s.input == kNone || s.output == kNone) continue;
    animation.channels.push_back({channel.pointer(), node, s.input, s.output, s.interpolation, *path});
  }
}

float positive(const JsonRef& json, float fallback, const char* what) {
  const float value = json.real(fallback);
  if (value > 0) return value;
  json.problem(std::string("is not positive; write ") + what);
  return fallback;
}

void parsePerspective(CameraData& camera, const JsonRef& json) {
  camera.yfov = positive(json["yfov"].required("write the vertical angle of view in radians"), camera.yfov,
                         "an angle in radians");
  if (camera.yfov >= kPi) {
    json["yfov"].problem("is at least pi; write an angle in radians below 3.14159");
    camera.yfov = 0.8f;
  }
  if (json["aspectRatio"]) camera.aspect = positive(json["aspectRatio"], 1, "width divided by height");
  // Planes do not clip a path tracer; they are only checked.
  if (json["znear"] && json["znear"].real(1) <= 0)
    json["znear"].warn("a camera's znear is not positive; clipping planes are ignored anyway");
}

float halfExtent(const JsonRef& json) {
  const float value = json.required("write half the extent of the view in metres").real(1);
  if (value < 0) json.warn("is negative; its absolute value is used");
  if (value == 0) json.problem("is 0; write half the extent of the view in metres");
  return value == 0 ? 1 : std::abs(value);
}

void parseCamera(CameraData& camera, const JsonRef& json) {
  camera.name = json["name"].text();
  const std::string type = json["type"].required("write perspective or orthographic").text("perspective");
  if (type == "perspective") {
    parsePerspective(camera, json["perspective"].required("describe the camera"));
  } else if (type == "orthographic") {
    const JsonRef orthographic = json["orthographic"].required("describe the camera");
    camera.orthographic = true;
    camera.xmag = halfExtent(orthographic["xmag"]);
    camera.ymag = halfExtent(orthographic["ymag"]);
  } else {
    json["type"].problem("is " + quoted(type) + "; it must be perspective or orthographic");
  }
}

void parseCone(PunctualLight& light, const JsonRef& spot) {
  light.outerConeAngle = spot["outerConeAngle"].clamped(kPi / 4, 1e-4f, kPi / 2);
  light.innerConeAngle = spot["innerConeAngle"].clamped(0, 0, kPi / 2);
  if (light.innerConeAngle < light.outerConeAngle) return;
  spot["innerConeAngle"].warn("a light's inner cone is not smaller than its outer cone; it is narrowed");
  light.innerConeAngle = light.outerConeAngle * 0.999f;
}

void parseLight(PunctualLight& light, const JsonRef& json) {
  light.name = json["name"].text();
  float color[3] = {1, 1, 1};
  json["color"].reals(color, 3);
  if (*std::min_element(color, color + 3) < 0) json["color"].warn("is negative; 0 is used");
  const float intensity = json["intensity"].clamped(1, 0, std::numeric_limits<float>::max());
  light.intensity = glm::max(Spectrum(color[0], color[1], color[2]), Spectrum(0)) * intensity;
  if (!isFinite(light.intensity)) json["intensity"].problem("times color is too large; write a smaller number");
  const std::string type = json["type"].required("write point, spot or directional").text("point");
  if (type == "spot") {
    light.kind = PunctualKind::Spot;
    parseCone(light, json["spot"].required("describe the cone"));
  } else if (type == "directional") {
    light.kind = PunctualKind::Directional;
  } else if (type != "point") {
    json["type"].problem("is " + quoted(type) + "; it must be point, spot or directional");
  }
  if (json["range"] && light.kind != PunctualKind::Directional)
    light.range = positive(json["range"], kInfinity, "a distance in metres");
}

}  // namespace

void parseNodes(Document& document, const JsonRef& root) {
  const JsonRef list = root["nodes"];
  const JsonRef lights = root.extension("KHR_lights_punctual")["lights"];
  const std::array<size_t, 3> counts{root["cameras"].size(), root["skins"].size(), lights.size()};
  document.nodes.resize(list.size());
  for (size_t i = 0; i < document.nodes.size(); ++i) parseNode(document, document.nodes[i], list.at(i), counts);
  parseSkins(document, root["skins"]);
  parseScenes(document, root);
}

void parseAnimations(Document& document, const JsonRef& root) {
  const JsonRef list = root["animations"];
  document.animations.resize(list.size());
  for (size_t i = 0; i < document.animations.size(); ++i) parseAnimation(document, document.animations[i], list.at(i));
}

void parseCamerasAndLights(Document& document, const JsonRef& root) {
  const JsonRef cameras = root["cameras"];
  document.cameras.resize(cameras.size());
  for (size_t i = 0; i < document.cameras.size(); ++i) parseCamera(document.cameras[i], cameras.at(i));
  const JsonRef lights = root.extension("KHR_lights_punctual")["lights"];
  document.lights.resize(lights.size());
  for (size_t i = 0; i < document.lights.size(); ++i) parseLight(document.lights[i], lights.at(i));
}

}  // namespace braid::gltf
