// SPDX-License-Identifier: Apache-2.0
// Checks that span several objects of a file: accessors against their data, primitives, skins, animations and the node
// tree. What fails is reported and taken out of the model, so that the rest can be built without looking back.
#include <algorithm>
#include <cmath>
#include <functional>

#include "renderer/scene/gltf/document/gltf_accessor.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"

namespace braid::gltf {

namespace {

std::string place(const char* array, size_t index) { return std::string("/") + array + '/' + std::to_string(index); }

class Validator {
 public:
  explicit Validator(Document& document)
      : document_(document), model_(document.model), report_(document.report), largest_(model_.accessors.size()) {}

  void meshes() {
    for (size_t m = 0; m < model_.meshes.size(); ++m) {
      tinygltf::Mesh& mesh = model_.meshes[m];
      if (mesh.primitives.empty()) report_.warn(place("meshes", m), "a mesh has no primitives");
      for (size_t p = 0; p < mesh.primitives.size(); ++p)
        checkPrimitive(mesh.primitives[p], place("meshes", m) + "/primitives/" + std::to_string(p));
      if (!mesh.weights.empty()) checkWeights(mesh, mesh.weights.size(), place("meshes", m) + "/weights");
    }
  }

  void skins() {
    for (size_t i = 0; i < model_.skins.size(); ++i) {
      tinygltf::Skin& skin = model_.skins[i];
      if (skin.joints.empty()) {
        report_.problem(place("skins", i) + "/joints", "is empty; list the nodes that move the skin",
                        "the mesh stays at rest");
      }
      const std::string where = place("skins", i) + "/inverseBindMatrices";
      if (!isUsable(skin.inverseBindMatrices)) continue;
      if (!hasShape(skin.inverseBindMatrices, where, 16, 16, isFloat, "joints have no bind matrices")) {
        skin.inverseBindMatrices = -1;
        continue;
      }
      const uint64_t count = document_.accessor(skin.inverseBindMatrices).count;
      if (count < skin.joints.size()) {
        report_.problem(where,
                        "has " + counted(count, "matrix", "matrices") + " for " +
                            counted(skin.joints.size(), "joint", "joints") + "; write one for each",
                        "the others are the identity");
      }
    }
  }

  void nodes() {
    document_.parents.assign(model_.nodes.size(), -1);
    findParents();
    cutCycles();
    for (size_t i = 0; i < model_.nodes.size(); ++i) checkNode(model_.nodes[i], place("nodes", i));
    for (size_t s = 0; s < model_.scenes.size(); ++s) {
      for (const int root : model_.scenes[s].nodes) {
        if (root >= 0 && document_.parents[static_cast<size_t>(root)] >= 0)
          report_.warn(place("scenes", s) + "/nodes", "a scene lists a node that has a parent");
      }
    }
  }

  void animations() {
    for (size_t i = 0; i < model_.animations.size(); ++i) {
      tinygltf::Animation& animation = model_.animations[i];
      for (size_t c = 0; c < animation.channels.size(); ++c)
        checkChannel(animation, animation.channels[c], place("animations", i) + "/channels/" + std::to_string(c));
    }
  }

 private:
  static bool isFloat(const Accessor& a) { return a.componentType == kF32; }
  static bool isFraction(const Accessor& a) { return a.componentType != kU32; }
  static bool isJoint(const Accessor& a) { return a.componentType == kU8 || a.componentType == kU16; }
  static bool isAny(const Accessor&) { return true; }

  bool isUsable(int accessor) const { return accessor >= 0 && document_.accessor(accessor).count > 0; }

  template <class Rule>
  bool hasShape(int index, const std::string& where, uint32_t low, uint32_t high, const Rule& rule,
                const char* meanwhile = "it is left out") {
    const Accessor& accessor = document_.accessor(index);
    const uint32_t n = componentsOf(accessor);
    if (n >= low && n <= high && rule(accessor)) return true;
    report_.problem(where,
                    "accessor " + std::to_string(index) +
                        " has the wrong type or componentType for this use; export the file again",
                    meanwhile);
    return false;
  }

  bool checkAttribute(const std::string& name, int accessor, const std::string& where) {
    if (name == "POSITION" || name == "NORMAL") return hasShape(accessor, where, 3, 3, isFraction);
    if (name == "TANGENT") return hasShape(accessor, where, 3, 4, isFraction);
    if (name.starts_with("TEXCOORD_")) return hasShape(accessor, where, 2, 2, isFraction);
    if (name.starts_with("COLOR_")) return hasShape(accessor, where, 3, 4, isFraction);
    if (name.starts_with("WEIGHTS_")) return hasShape(accessor, where, 4, 4, isFraction);
    if (!name.starts_with("JOINTS_")) return true;
    if (!hasShape(accessor, where, 4, 4, isAny)) return false;
    hasShape(accessor, where, 4, 4, isJoint, "its numbers are read as they are");
    return true;
  }

  // Attributes that cannot be read are as if absent; without POSITION nothing is drawn.
  void checkAttributes(const Primitive& primitive, Attributes& attributes, uint64_t vertices,
                       const std::string& where) {
    std::erase_if(attributes, [&](const auto& entry) {
      const auto& [name, accessor] = entry;
      const std::string at = where + '/' + name;
      const uint64_t count = document_.accessor(accessor).count;
      bool readable = isUsable(accessor) && checkAttribute(name, accessor, at);
      if (readable && vertices > 0 && count != vertices) {
        report_.problem(at,
                        "accessor " + std::to_string(accessor) + " has " + counted(count, "element", "elements") +
                            ", but POSITION has " + std::to_string(vertices) + "; all attributes need the same count",
                        "it is left out");
        readable = false;
      }
      if (!readable) document_.unreadable[&primitive].push_back(accessor);
      return !readable;
    });
  }

  void checkPrimitive(Primitive& primitive, const std::string& where) {
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) {
      report_.warn(where, "a primitive without POSITION is skipped");
      return;
    }
    const uint64_t vertices = document_.accessor(position->second).count;
    if (vertices == 0) report_.warn(where, "a primitive has no vertices that can be read; it is left out");
    checkAttributes(primitive, primitive.attributes, vertices, where + "/attributes");
    for (size_t t = 0; t < primitive.targets.size(); ++t)
      checkAttributes(primitive, primitive.targets[t], vertices, where + "/targets/" + std::to_string(t));
    if (primitive.extensions.contains("KHR_draco_mesh_compression")) {
      if (primitive.mode != 4 && primitive.mode != 5)
        report_.problem(where + "/mode", "must be 4 or 5 for a compressed mesh",
                        "its uncompressed data is drawn, where there is any");
    }
    checkIndices(primitive, vertices, where + "/indices");
  }

  // Indices that cannot be read at all leave nothing to draw.
  void checkIndices(Primitive& primitive, uint64_t vertices, const std::string& where) {
    if (primitive.indices < 0) return;
    const Accessor& accessor = document_.accessor(primitive.indices);
    const bool isPacked = primitive.extensions.contains("KHR_draco_mesh_compression");
    if (isPacked && accessor.bufferView < 0) return;
    if (!hasShape(primitive.indices, where, 1, 1, isIndex, "the primitive is left out")) primitive.indices = -2;
    if (!isUsable(primitive.indices) || vertices == 0 || isPacked) return;
    const uint32_t largest = largestValue(primitive.indices);
    if (largest < vertices) return;
    report_.problem(where,
                    "accessor " + std::to_string(primitive.indices) + " holds the index " + std::to_string(largest) +
                        ", but there are " + counted(vertices, "vertex", "vertices") + "; correct the indices",
                    "the triangles of such vertices are left out");
  }

  // Computed once per accessor, however many primitives share it.
  uint32_t largestValue(int accessor) {
    std::optional<uint32_t>& value = largest_[static_cast<size_t>(accessor)];
    if (!value) {
      value = 0;
      for (const uint32_t v : readIntegers(document_, accessor)) value = std::max(*value, v);
    }
    return *value;
  }

  void checkWeights(const tinygltf::Mesh& mesh, size_t count, const std::string& where) {
    for (const Primitive& primitive : mesh.primitives) {
      if (primitive.targets.size() == count) continue;
      report_.warn(where, "the number of weights differs from that of morph targets; missing ones are 0");
      return;
    }
  }

  // The first parent that names a node keeps it.
  void findParents() {
    for (size_t i = 0; i < model_.nodes.size(); ++i) {
      std::erase_if(model_.nodes[i].children, [&](int child) {
        if (child < 0) return true;  // reported with the JSON
        int& parent = document_.parents[static_cast<size_t>(child)];
        if (parent < 0) {
          parent = static_cast<int>(i);
          return false;
        }
        report_.problem(place("nodes", i) + "/children",
                        "names node " + std::to_string(child) + ", already a child of node " + std::to_string(parent) +
                            "; nodes must form a tree: copy it",
                        "it stays with the first");
        return true;
      });
    }
  }

  // Each node has one parent, so a cycle is found by walking upwards; nodes known to be good end the walk.
  void cutCycles() {
    std::vector<int> seenFrom(model_.nodes.size(), -1);
    const auto at = [](int node) { return static_cast<size_t>(node); };
    for (int start = 0; at(start) < model_.nodes.size(); ++start) {
      int node = start;
      while (node >= 0 && seenFrom[at(node)] < 0) {
        seenFrom[at(node)] = start;
        node = document_.parents[at(node)];
      }
      if (node < 0 || seenFrom[at(node)] != start) continue;
      report_.problem(
          place("nodes", at(node)) + "/children",
          "leads back to node " + std::to_string(node) + " itself; nodes must form a tree: remove the cycle",
          "the cycle is cut there");
      std::erase(model_.nodes[at(document_.parents[at(node)])].children, node);
      document_.parents[at(node)] = -1;
    }
  }

  void checkNode(tinygltf::Node& node, const std::string& where) {
    checkTransform(node, where);
    if (node.mesh < 0) {
      if (node.skin >= 0) report_.warn(where + "/skin", "a node has a skin but no mesh");
      return;
    }
    const tinygltf::Mesh& mesh = model_.meshes[static_cast<size_t>(node.mesh)];
    if (!node.weights.empty()) checkWeights(mesh, node.weights.size(), where + "/weights");
    if (node.skin >= 0) {
      for (size_t p = 0; p < mesh.primitives.size(); ++p)
        checkJoints(mesh.primitives[p], node.skin,
                    place("meshes", static_cast<size_t>(node.mesh)) + "/primitives/" + std::to_string(p));
    }
    checkInstancing(instancingOf(node), where + "/extensions/EXT_mesh_gpu_instancing/attributes");
  }

  void checkTransform(tinygltf::Node& node, const std::string& where) {
    if (std::vector<double>& m = node.matrix; m.size() == 16) {
      // Inverses and products come out with rounding in the last row; only more than that is a projection.
      const double off = std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11]), std::abs(m[15] - 1)});
      if (!(off <= 1e-5)) {
        report_.problem(where + "/matrix", "is not affine; its last row must be 0 0 0 1", "0 0 0 1 is used");
      }
      m[3] = m[7] = m[11] = 0;
      m[15] = 1;
    }
    if (const std::vector<double>& r = node.rotation; r.size() == 4) {
      const double length = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
      if (!(length > 1e-6))
        report_.warn(where + "/rotation", "is zero; no rotation is used");
      else if (std::abs(length - 1) > 1e-2)
        report_.warn(where + "/rotation", "a rotation is not a unit quaternion; it is normalised");
    }
  }

  void checkJoints(const Primitive& primitive, int skin, const std::string& where) {
    const size_t joints = model_.skins[static_cast<size_t>(skin)].joints.size();
    if (joints == 0) return;
    for (const auto& [name, accessor] : primitive.attributes) {
      if (!name.starts_with("JOINTS_") || !isUsable(accessor) || !isIndex(document_.accessor(accessor))) continue;
      const uint32_t largest = largestValue(accessor);
      if (largest < joints) continue;
      report_.problem(where + "/attributes/" + name,
                      "names joint " + std::to_string(largest) + ", but skin " + std::to_string(skin) + " has " +
                          counted(joints, "joint", "joints") + "; correct the skin or the joints",
                      "such joints move nothing");
    }
  }

  void checkInstancing(const Attributes& instancing, const std::string& where) {
    uint64_t count = 0;
    for (const auto& [name, accessor] : instancing) {
      if (!isUsable(accessor)) continue;
      const uint32_t n = name == "ROTATION" ? 4 : 3;
      hasShape(accessor, where + '/' + name, n, n, isFraction);
      const uint64_t own = document_.accessor(accessor).count;
      if (count != 0 && own != count)
        report_.problem(where + '/' + name, "has another count than the other attributes; all need the same",
                        "missing ones are at rest");
      count = own;
    }
  }

  // A channel that cannot be read moves nothing; the rest of the clip does.
  void checkChannel(const tinygltf::Animation& animation, tinygltf::AnimationChannel& channel,
                    const std::string& where) {
    if (channel.sampler < 0) return;
    const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<size_t>(channel.sampler)];
    if (!isUsable(sampler.input) || !isUsable(sampler.output) || channel.target_path == "pointer") return;
    const uint64_t width = animatedWidth(document_, channel);
    const uint32_t n = channel.target_path == "weights" ? 1 : static_cast<uint32_t>(width);
    const char* const meanwhile = "its target stays at rest";
    bool valid = width > 0 && hasShape(sampler.input, where + "/sampler", 1, 1, isFloat, meanwhile) &&
                 hasShape(sampler.output, where + "/sampler", n, n, isFraction, meanwhile);
    const uint64_t keys = document_.accessor(sampler.input).count, values = document_.accessor(sampler.output).count;
    const uint64_t perKey = (sampler.interpolation == "CUBICSPLINE" ? 3 : 1) * (n == 1 ? width : 1);
    if (valid && values < keys * perKey) {
      report_.problem(where + "/sampler",
                      "has " + counted(values, "value", "values") + " for " + counted(keys, "key time", "key times") +
                          "; it needs " + std::to_string(keys * perKey),
                      meanwhile);
      valid = false;
    }
    if (!valid) channel.target_node = -1;
  }

  Document& document_;
  tinygltf::Model& model_;
  Report& report_;
  std::vector<std::optional<uint32_t>> largest_;
};

}  // namespace

void validate(Document& document) {
  validateAccessors(document);
  Validator validator(document);
  validator.meshes();
  validator.skins();
  validator.nodes();
  validator.animations();
}

}  // namespace braid::gltf
