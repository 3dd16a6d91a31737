// SPDX-License-Identifier: Apache-2.0
// Checks that span several objects of a file: accessors against their data, primitives, skins, animations and the node
// tree.
#include <algorithm>
#include <functional>

#include "renderer/scene/gltf_accessor.h"

namespace braid::gltf {

namespace {

std::string place(const char* array, size_t index) { return std::string("/") + array + '/' + std::to_string(index); }

class Validator {
 public:
  explicit Validator(Document& document)
      : document_(document), report_(document.report), largest_(document.accessors.size()) {}

  void accessors() {
    for (size_t i = 0; i < document_.accessors.size(); ++i) {
      Accessor& accessor = document_.accessors[i];
      if (accessor.valid) accessor.valid = checkAccessor(accessor, place("accessors", i));
    }
  }

  void meshes() {
    for (size_t m = 0; m < document_.meshes.size(); ++m) {
      const Mesh& mesh = document_.meshes[m];
      if (mesh.primitives.empty()) report_.warn(place("meshes", m), "a mesh has no primitives");
      for (const Primitive& primitive : mesh.primitives) checkPrimitive(primitive);
      if (!mesh.weights.empty()) checkWeights(mesh, mesh.weights.size(), place("meshes", m) + "/weights");
    }
  }

  void skins() {
    for (size_t i = 0; i < document_.skins.size(); ++i) {
      const Skin& skin = document_.skins[i];
      if (skin.joints.empty())
        report_.problem(place("skins", i) + "/joints", "is empty; list the nodes that move the skin");
      const std::string where = place("skins", i) + "/inverseBindMatrices";
      if (!isUsable(skin.inverseBindMatrices)) continue;
      if (!hasShape(skin.inverseBindMatrices, where, 16, 16, isFloat)) continue;
      const uint64_t count = document_.accessors[skin.inverseBindMatrices].count;
      if (count < skin.joints.size()) {
        report_.problem(where, "has " + counted(count, "matrix", "matrices") + " for " +
                                   counted(skin.joints.size(), "joint", "joints") + "; write one for each");
      }
    }
  }

  void nodes() {
    findParents();
    findCycles();
    for (size_t i = 0; i < document_.nodes.size(); ++i) checkNode(document_.nodes[i], place("nodes", i));
    for (size_t s = 0; s < document_.scenes.size(); ++s) {
      for (const uint32_t root : document_.scenes[s].nodes) {
        if (document_.nodes[root].parent != kNone)
          report_.warn(place("scenes", s) + "/nodes", "a scene lists a node that has a parent");
      }
    }
  }

  void animations() {
    for (const Animation& animation : document_.animations) {
      for (const AnimationChannel& channel : animation.channels) checkChannel(channel);
    }
  }

 private:
  static bool isFloat(const Accessor& a) { return a.component == Component::F32; }
  static bool isFraction(const Accessor& a) { return a.component != Component::U32; }
  static bool isIndex(const Accessor& a) {
    return a.component == Component::U8 || a.component == Component::U16 || a.component == Component::U32;
  }
  static bool isJoint(const Accessor& a) { return a.component == Component::U8 || a.component == Component::U16; }

  // `count` elements of `size` bytes, `stride` apart, from `offset` within a view.
  bool fits(uint32_t viewIndex, uint64_t offset, uint64_t stride, uint64_t size, uint64_t count,
            const std::string& where) {
    const BufferView& view = document_.views[viewIndex];
    if (!view.valid) return false;  // reported with the view
    const uint64_t length = view.data.size();
    if (count == 0) return true;
    if (offset <= length && size <= length - offset && count - 1 <= (length - offset - size) / stride) return true;
    report_.problem(where, "needs " + counted(count, "element", "elements") + " of " + counted(size, "byte", "bytes") +
                               " at a stride of " + std::to_string(stride) + " from byte " + std::to_string(offset) +
                               ", but bufferView " + std::to_string(viewIndex) + " has " +
                               counted(length, "byte", "bytes") + "; correct count, byteOffset or the view");
    return false;
  }

  bool checkAccessor(const Accessor& accessor, const std::string& where) {
    // Zeros without data cost nothing in the file, so their number needs a bound of its own.
    constexpr uint64_t kMostZeros = uint64_t(1) << 24;
    const uint64_t size = elementBytes(accessor);
    if (accessor.view == kNone && accessor.count > kMostZeros) {
      report_.problem(where + "/count", "is " + std::to_string(accessor.count) +
                                            ", too many for an accessor without a bufferView; add one");
      return false;
    }
    bool valid = true;
    if (accessor.view != kNone) {
      const uint64_t declared = document_.views[accessor.view].stride;
      if (declared != 0 && declared < size && accessor.count > 1) {
        report_.problem(place("bufferViews", accessor.view) + "/byteStride",
                        "is " + std::to_string(declared) + ", less than the " + std::to_string(size) +
                            " bytes of one element; correct it");
        return false;
      }
      valid = fits(accessor.view, accessor.offset, declared != 0 ? declared : size, size, accessor.count, where);
    }
    return (!accessor.sparse || checkSparse(accessor, where + "/sparse")) && valid;
  }

  bool checkSparse(const Accessor& accessor, const std::string& where) {
    const SparseAccessor& sparse = *accessor.sparse;
    if (sparse.count > accessor.count) {
      report_.problem(where + "/count", "is " + std::to_string(sparse.count) + ", more than the accessor's " +
                                            std::to_string(accessor.count) + " elements; correct it");
      return false;
    }
    const uint64_t indexBytes = componentBytes(sparse.indexType), valueBytes = elementBytes(accessor);
    if (!fits(sparse.indexView, sparse.indexOffset, indexBytes, indexBytes, sparse.count, where + "/indices"))
      return false;
    if (!fits(sparse.valueView, sparse.valueOffset, valueBytes, valueBytes, sparse.count, where + "/values"))
      return false;
    Accessor scalar;
    scalar.component = sparse.indexType;
    if (!isIndex(scalar)) {
      report_.problem(where + "/indices/componentType", "must be 5121, 5123 or 5125");
      return false;
    }
    const std::vector<uint32_t> indices = sparseIndices(document_, sparse);
    const bool ascending = std::adjacent_find(indices.begin(), indices.end(), std::greater_equal<>()) == indices.end();
    if (ascending && (indices.empty() || indices.back() < accessor.count)) return true;
    report_.problem(where + "/indices", "must increase and stay below the accessor's count, " +
                                            std::to_string(accessor.count) + "; export the file again");
    return false;
  }

  bool isUsable(uint32_t accessor) const { return accessor != kNone && document_.accessors[accessor].valid; }

  template <class Rule>
  bool hasShape(uint32_t index, const std::string& where, uint32_t low, uint32_t high, const Rule& rule) {
    const Accessor& accessor = document_.accessors[index];
    const uint32_t n = accessor.components();
    if (n >= low && n <= high && rule(accessor)) return true;
    report_.problem(where, "accessor " + std::to_string(index) +
                               " has the wrong type or componentType for this use; export the file again");
    return false;
  }

  bool checkAttribute(const std::string& name, uint32_t accessor, const std::string& where) {
    if (name == "POSITION" || name == "NORMAL") return hasShape(accessor, where, 3, 3, isFraction);
    if (name == "TANGENT") return hasShape(accessor, where, 3, 4, isFraction);
    if (name.starts_with("TEXCOORD_")) return hasShape(accessor, where, 2, 2, isFraction);
    if (name.starts_with("COLOR_")) return hasShape(accessor, where, 3, 4, isFraction);
    if (name.starts_with("JOINTS_")) return hasShape(accessor, where, 4, 4, isJoint);
    if (name.starts_with("WEIGHTS_")) return hasShape(accessor, where, 4, 4, isFraction);
    return true;
  }

  void checkAttributes(const Attributes& attributes, uint64_t vertices, const std::string& where) {
    for (const auto& [name, accessor] : attributes) {
      if (!isUsable(accessor)) continue;
      const std::string at = where + '/' + name;
      checkAttribute(name, accessor, at);
      const uint64_t count = document_.accessors[accessor].count;
      if (count == vertices) continue;
      report_.problem(at, "accessor " + std::to_string(accessor) + " has " + counted(count, "element", "elements") +
                              ", but POSITION has " + std::to_string(vertices) +
                              "; all attributes need the same count");
    }
  }

  void checkPrimitive(const Primitive& primitive) {
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) {
      report_.warn(primitive.pointer, "a primitive without POSITION is skipped");
      return;
    }
    const uint64_t vertices = document_.accessors[position->second].count;
    // Compressed attributes have no data of their own.
    checkAttributes(primitive.attributes, vertices, primitive.pointer + "/attributes");
    for (size_t t = 0; t < primitive.targets.size(); ++t) {
      checkAttributes(primitive.targets[t], vertices, primitive.pointer + "/targets/" + std::to_string(t));
    }
    if (!primitive.draco && isUsable(position->second)) checkIndices(primitive, vertices);
    if (primitive.draco && primitive.draco->view != kNone && primitive.mode != 4 && primitive.mode != 5) {
      report_.problem(primitive.pointer + "/mode", "must be 4 or 5 for a compressed mesh");
    }
  }

  void checkIndices(const Primitive& primitive, uint64_t vertices) {
    if (!isUsable(primitive.indices)) return;
    const std::string where = primitive.pointer + "/indices";
    if (!hasShape(primitive.indices, where, 1, 1, isIndex) || document_.accessors[primitive.indices].count == 0) return;
    const uint32_t largest = largestValue(primitive.indices);
    if (largest < vertices) return;
    report_.problem(where, "accessor " + std::to_string(primitive.indices) + " holds the index " +
                               std::to_string(largest) + ", but there are " + counted(vertices, "vertex", "vertices") +
                               "; correct the indices");
  }

  // Computed once per accessor, however many primitives share it.
  uint32_t largestValue(uint32_t accessor) {
    std::optional<uint32_t>& value = largest_[accessor];
    if (!value) {
      value = 0;
      for (const uint32_t v : readIntegers(document_, accessor)) value = std::max(*value, v);
    }
    return *value;
  }

  void checkWeights(const Mesh& mesh, size_t count, const std::string& where) {
    for (const Primitive& primitive : mesh.primitives) {
      if (primitive.targets.size() == count) continue;
      report_.warn(where, "the number of weights differs from that of morph targets; missing ones are 0");
      return;
    }
  }

  void findParents() {
    for (size_t i = 0; i < document_.nodes.size(); ++i) {
      for (const uint32_t child : document_.nodes[i].children) {
        uint32_t& parent = document_.nodes[child].parent;
        if (parent == kNone) {
          parent = static_cast<uint32_t>(i);
        } else {
          report_.problem(place("nodes", i) + "/children", "names node " + std::to_string(child) +
                                                               ", already a child of node " + std::to_string(parent) +
                                                               "; nodes must form a tree: copy it");
        }
      }
    }
  }

  // Each node has one parent, so a cycle is found by walking upwards; nodes known to be good end the walk.
  void findCycles() {
    std::vector<uint32_t> seenFrom(document_.nodes.size(), kNone);
    for (uint32_t start = 0; start < document_.nodes.size(); ++start) {
      uint32_t node = start;
      while (node != kNone && seenFrom[node] == kNone) {
        seenFrom[node] = start;
        node = document_.nodes[node].parent;
      }
      if (node == kNone || seenFrom[node] != start) continue;
      report_.problem(place("nodes", node) + "/children", "leads back to node " + std::to_string(node) +
                                                              " itself; nodes must form a tree: "
                                                              "remove the cycle");
    }
  }

  void checkNode(const Node& node, const std::string& where) {
    if (node.mesh == kNone) {
      if (node.skin != kNone) report_.warn(where + "/skin", "a node has a skin but no mesh");
      return;
    }
    const Mesh& mesh = document_.meshes[node.mesh];
    if (node.weights) checkWeights(mesh, node.weights->size(), where + "/weights");
    if (node.skin != kNone) {
      for (const Primitive& primitive : mesh.primitives) checkJoints(primitive, node.skin);
    }
    checkInstancing(node, where + "/extensions/EXT_mesh_gpu_instancing/attributes");
  }

  void checkJoints(const Primitive& primitive, uint32_t skin) {
    const size_t joints = document_.skins[skin].joints.size();
    for (const auto& [name, accessor] : primitive.attributes) {
      if (!name.starts_with("JOINTS_") || !isUsable(accessor) || !isJoint(document_.accessors[accessor])) continue;
      const uint32_t largest = largestValue(accessor);
      if (largest < joints) continue;
      report_.problem(primitive.pointer + "/attributes/" + name,
                      "names joint " + std::to_string(largest) + ", but skin " + std::to_string(skin) + " has " +
                          counted(joints, "joint", "joints") + "; correct the skin or the joints");
    }
  }

  void checkInstancing(const Node& node, const std::string& where) {
    uint64_t count = 0;
    for (const auto& [name, accessor] : node.instancing) {
      if (!isUsable(accessor)) continue;
      const uint32_t n = name == "ROTATION" ? 4 : 3;
      hasShape(accessor, where + '/' + name, n, n, isFraction);
      const uint64_t own = document_.accessors[accessor].count;
      if (count != 0 && own != count)
        report_.problem(where + '/' + name, "has another count than the other attributes; all need the same");
      count = own;
    }
  }

  void checkChannel(const AnimationChannel& channel) {
    if (!isUsable(channel.input) || !isUsable(channel.output)) return;
    if (!hasShape(channel.input, channel.pointer + "/sampler", 1, 1, isFloat)) return;
    const uint32_t n = channel.path == AnimatedPath::Rotation ? 4 : channel.path == AnimatedPath::Weights ? 1 : 3;
    if (!hasShape(channel.output, channel.pointer + "/sampler", n, n, isFraction)) return;
    const uint64_t keys = document_.accessors[channel.input].count;
    const uint64_t perKey = (channel.interpolation == Interpolation::Cubic ? 3 : 1) * widthOf(channel);
    if (document_.accessors[channel.output].count >= keys * perKey) return;
    report_.problem(channel.pointer + "/sampler",
                    "has " + counted(document_.accessors[channel.output].count, "value", "values") + " for " +
                        counted(keys, "key time", "key times") + "; it needs " + std::to_string(keys * perKey));
  }

  // Values of one key.
  uint64_t widthOf(const AnimationChannel& channel) const {
    if (channel.path != AnimatedPath::Weights) return 1;
    const uint32_t mesh = document_.nodes[channel.node].mesh;
    if (mesh == kNone || document_.meshes[mesh].primitives.empty()) return 0;
    return document_.meshes[mesh].primitives.front().targets.size();
  }

  Document& document_;
  Report& report_;
  std::vector<std::optional<uint32_t>> largest_;
};

}  // namespace

void validate(Document& document) {
  Validator validator(document);
  validator.accessors();
  validator.meshes();
  validator.skins();
  validator.nodes();
  validator.animations();
}

}  // namespace braid::gltf
