// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/gltf_mesh.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/gltf/document/gltf_accessor.h"
#include "renderer/scene/gltf/mesh_repair.h"
#include "renderer/scene/gltf/poses/skinning.h"
#include "renderer/scene/data/placement.h"
#include "renderer/scene/gltf/tangents.h"

namespace braid::gltf {

namespace {

class MeshBuilder {
 public:
  MeshBuilder(const Document& document, const MeshJob& job, Report& report)
      : document_(document), job_(job), primitive_(*job.primitive), report_(report) {}

  TriangleMesh build() {
    if (!open()) return {};
    readIndices();
    if (!isRound()) readTriangles();
    selectVertices();
    mesh_.positions = morphed<Vec3>("POSITION");
    if (mesh_.positions.size() != vertices_) {
      report_.problem(job_.place, "holds positions that are no points; compress the file again", "it is left out");
      return {};
    }
    if (!isRound()) mesh_.normals = morphed<Vec3>("NORMAL");
    // Supplied tangents belong to supplied normals; without those they are to be ignored.
    if (!mesh_.normals.empty() && wantsTangents()) readTangents();
    readUvs();
    readColors();
    if (job_.joints) {
      if (job_.origin == glm::dvec3(0)) {
        skin<float>();
      } else {
        skin<double>();  // floats would lose what is left of sums of large numbers
      }
    }
    if (isRound()) thicken();
    if (!dropBadTriangles(mesh_, report_, job_.place)) return {};
    compactVertices(mesh_, extras_);
    repairNormals(mesh_, report_, job_.place);
    finishTangents();
    mesh_.name = job_.name;
    mesh_.material = job_.material;
    mesh_.padForEmbree();
    return std::move(mesh_);
  }

 private:
  bool isRound() const { return primitive_.mode < 4; }
  bool wantsTangents() const { return !isRound() && (job_.needsTangents || job_.keepAllAttributes); }

  // What cannot be drawn at all has no mesh; its flaw was reported.
  bool open() {
    if (primitive_.mode < 0 || primitive_.indices < -1) return false;
    if (isRound() && !(job_.round.radius > 0))
      report_.warn(job_.place, "points and lines are not drawn; --point-radius METRES makes them spheres and rods");
    if (isRound() && !canBeRound()) return false;
    const auto position = primitive_.attributes.find("POSITION");
    if (position == primitive_.attributes.end()) return false;
    vertices_ = fileVertices_ = document_.accessor(position->second).count;
    if (isPacked(primitive_)) {
      if (primitive_.mode == 4 || primitive_.mode == 5) draco_ = decodeDraco(document_, job_, report_);
      if (!draco_ && !hasData("POSITION")) return false;
      if (draco_) vertices_ = fileVertices_ = draco_->vertices;
    }
    if (vertices_ > std::numeric_limits<uint32_t>::max()) {
      report_.problem(job_.place, "has more than 2^32 vertices; split it", "it is left out");
      return false;
    }
    return vertices_ > 0;
  }

  // Accessors of compressed attributes have no data of their own, which means zeros elsewhere.
  bool hasData(const std::string& name) const {
    const auto found = primitive_.attributes.find(name);
    if (found == primitive_.attributes.end()) return false;
    const Accessor& accessor = document_.accessor(found->second);
    return !isPacked(primitive_) || accessor.bufferView >= 0 || accessor.sparse.isSparse;
  }

  bool has(const std::string& name) const { return primitive_.attributes.contains(name); }

  // The values of an attribute and their number per vertex; nothing if it is absent.
  std::vector<float> values(const std::string& name, uint32_t& components) {
    components = 0;
    if (draco_) {
      const auto found = draco_->attributes.find(name);
      if (found != draco_->attributes.end()) {
        components = found->second.components;
        return std::move(found->second.values);
      }
    }
    if (!hasData(name)) return {};
    const int index = primitive_.attributes.at(name);
    const Accessor& accessor = document_.accessor(index);
    if (accessor.count != fileVertices_) {
      if (draco_ && accessor.count > 0)
        report_.warn(job_.place, "attribute " + quoted(name) + " does not fit the compressed mesh; it is ignored");
      return {};
    }
    components = componentsOf(accessor);
    const bool isFraction = name.starts_with("COLOR_") || name.starts_with("WEIGHTS_");
    return read(index, isFraction ? Integers::AlwaysNormalized : Integers::AsDeclared);
  }

  std::vector<float> read(int accessor, Integers integers = Integers::AsDeclared) const {
    return selected_.empty() ? readFloats(document_, accessor, integers)
                             : gatherFloats(document_, accessor, selected_, integers);
  }

  // Adds the weighted displacements of the morph targets. Those of tangents have three components, of colours three or
  // four.
  void addTargets(const std::string& name, std::vector<float>& base, uint32_t components) const {
    for (size_t t = 0; t < std::min(primitive_.targets.size(), job_.weights.size()); ++t) {
      const float weight = job_.weights[t];
      const auto found = primitive_.targets[t].find(name);
      if (weight == 0 || found == primitive_.targets[t].end()) continue;
      const Accessor& accessor = document_.accessor(found->second);
      const uint32_t width = componentsOf(accessor);
      if (accessor.count != fileVertices_ || width > components) continue;
      const std::vector<float> delta = read(found->second);
      for (size_t v = 0; v < vertices_; ++v) {
        for (size_t c = 0; c < width; ++c) base[v * components + c] += weight * delta[v * width + c];
      }
    }
  }

  template <class Vector>
  std::vector<Vector> morphed(const std::string& name) {
    uint32_t components = 0;
    std::vector<float> base = values(name, components);
    if (components != uint32_t(Vector::length())) return {};
    addTargets(name, base, components);
    return asVectors<Vector>(base);
  }

  void readIndices() {
    if (draco_) {
      indices_ = std::move(draco_->indices);
    } else if (primitive_.indices >= 0) {
      indices_ = readIntegers(document_, primitive_.indices);
    } else {
      indices_.resize(vertices_);
      for (size_t i = 0; i < indices_.size(); ++i) indices_[i] = static_cast<uint32_t>(i);
    }
  }

  void readTriangles() {
    const std::vector<uint32_t> indices = std::move(indices_);
    // A compressed strip comes out of its decoder as a list.
    if (primitive_.mode == 4 || draco_) {
      if (indices.size() % 3 != 0)
        report_.warn(job_.place, "the number of indices is not a multiple of 3; the rest is ignored");
      mesh_.triangles.resize(indices.size() / 3);
      for (size_t i = 0; i < mesh_.triangles.size(); ++i)
        mesh_.triangles[i] = {indices[3 * i], indices[3 * i + 1], indices[3 * i + 2]};
    } else {
      mesh_.triangles = joinedTriangles(indices, primitive_.mode == 5);
    }
    // Validation reported the indices of vertices that do not exist: only their triangles are lost.
    std::erase_if(mesh_.triangles,
                  [&](const glm::uvec3& t) { return t.x >= vertices_ || t.y >= vertices_ || t.z >= vertices_; });
  }

  bool canBeRound() const {
    if (!(job_.round.radius > 0)) return false;
    if (shapeOf(glm::dmat4(job_.round.toWorld)) == Shape::Solid) return true;
    report_.warn(job_.place, "points and lines that a scale of 0 makes flat are left out");
    return false;
  }

  void thicken() {
    uint64_t lost = 0;
    const Strokes strokes = strokesOf(primitive_.mode, indices_, mesh_.positions, lost);
    if (lost > 0) report_.warn(job_.place, "a point that does not exist or is not finite is dropped", lost);
    mesh_ = roundMesh(mesh_, strokes, job_.round);
  }

  // Many primitives may each use a small part of one large set of vertices: only that part is read.
  void selectVertices() {
    if (draco_ || mesh_.triangles.empty() || mesh_.triangles.size() * 12 > vertices_) return;
    for (const glm::uvec3& t : mesh_.triangles) selected_.insert(selected_.end(), {t.x, t.y, t.z});
    std::sort(selected_.begin(), selected_.end());
    selected_.erase(std::unique(selected_.begin(), selected_.end()), selected_.end());
    const auto place = [&](uint32_t v) {
      return static_cast<uint32_t>(std::lower_bound(selected_.begin(), selected_.end(), v) - selected_.begin());
    };
    for (glm::uvec3& t : mesh_.triangles) t = {place(t.x), place(t.y), place(t.z)};
    vertices_ = selected_.size();
  }

  void readTangents() { mesh_.tangents = morphed<Vec4>("TANGENT"); }

  std::vector<Vec2> readUv(uint32_t set) {
    return set == kNone ? std::vector<Vec2>() : morphed<Vec2>("TEXCOORD_" + std::to_string(set));
  }

  void readUvs() {
    for (uint32_t slot = 0; slot < kUvSlots; ++slot) {
      uint32_t set = job_.uvs.set[slot];
      if (set != kNone && !has("TEXCOORD_" + std::to_string(set))) {
        report_.warn(job_.place,
                     "a texture reads TEXCOORD_" + std::to_string(set) + ", which the primitive does not have");
      }
      if (set == kNone && job_.keepAllAttributes && slot < 2) set = slot;
      mesh_.uv[slot] = readUv(set);
      for (Vec2& uv : mesh_.uv[slot]) {
        if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) uv = Vec2(0);
      }
      slotSet_[slot] = set;
    }
    if (!wantsTangents() || !mesh_.tangents.empty()) return;
    for (const MaterialTable::TangentSource& source : job_.uvs.tangents)
      extras_.uv.push_back(slotOf(source.set) == kNone ? readUv(source.set) : std::vector<Vec2>());
  }

  uint32_t slotOf(uint32_t set) const {
    const auto found = std::find(slotSet_.begin(), slotSet_.end(), set);
    return found == slotSet_.end() ? kNone : static_cast<uint32_t>(found - slotSet_.begin());
  }

  void readColors() {
    uint32_t components = 0;
    std::vector<float> base = values("COLOR_0", components);
    if (components < 3) return;
    addTargets("COLOR_0", base, components);
    mesh_.colors.resize(vertices_);
    for (size_t v = 0; v < vertices_; ++v) {
      const float* c = &base[v * components];
      const Vec4 color(c[0], c[1], c[2], components == 4 ? c[3] : 1.0f);
      // Written so that NaN becomes 0.
      for (int k = 0; k < 4; ++k) mesh_.colors[v][k] = color[k] > 0 ? std::min(color[k], 1.0f) : 0.0f;
    }
  }

  template <class T>
  void skin() {
    Skinning<T> skinning(*job_.joints, job_.origin, vertices_);
    for (int k = 0; has("JOINTS_" + std::to_string(k)); ++k) {
      uint32_t jointWidth = 0, weightWidth = 0;
      const std::vector<float> joints = values("JOINTS_" + std::to_string(k), jointWidth),
                               weights = values("WEIGHTS_" + std::to_string(k), weightWidth);
      if (jointWidth == 4 && weightWidth == 4) {
        skinning.add(joints, weights);
      } else {
        report_.warn(job_.place, "JOINTS and WEIGHTS do not match; they are ignored");
      }
    }
    const uint64_t unweighted = skinning.apply(mesh_);
    if (unweighted > 0)
      report_.warn(job_.place, "a skinned vertex has no weights; it follows the first joint", unweighted);
  }

  void finishTangents() {
    if (!wantsTangents()) return;
    if (!mesh_.tangents.empty() && repairTangents(mesh_, report_, job_.place)) return;
    mesh_.tangents.clear();
    if (!job_.needsTangents) return;
    const size_t frames = job_.uvs.tangents.size();
    extras_.uv.resize(frames);
    for (size_t frame = 0; frame < frames; ++frame) layOut(frame);
    if (std::all_of(extras_.uv.begin(), extras_.uv.end(), [](const auto& uv) { return uv.empty(); })) {
      report_.warn(job_.place,
                   "a material needs tangents, but the primitive has neither tangents nor texture coordinates");
      return;
    }
    // Flat shading has a tangent frame for each triangle, so its vertices cannot be shared.
    if (mesh_.normals.empty()) splitIntoFlatTriangles(mesh_, extras_);
    for (size_t frame = 0; frame < frames; ++frame) {
      if (!extras_.uv[frame].empty()) generateTangents(mesh_, frame, extras_.uv);
    }
  }

  // Makes extras_.uv the coordinates by which the texture of a frame lies on the mesh, but for the offset.
  void layOut(size_t frame) {
    const MaterialTable::TangentSource& source = job_.uvs.tangents[frame];
    std::vector<Vec2>& uv = extras_.uv[frame];
    const uint32_t slot = slotOf(source.set);
    if (slot != kNone) uv = mesh_.uv[slot];
    const auto& [a, b, c, d] = source.linear;
    for (Vec2& v : uv) v = Vec2(a * v.x + b * v.y, c * v.x + d * v.y);
  }

  const Document& document_;
  const MeshJob& job_;
  const Primitive& primitive_;
  Report& report_;
  std::optional<DracoMesh> draco_;
  uint64_t fileVertices_ = 0;  // of the accessors
  uint64_t vertices_ = 0;      // read
  std::vector<uint32_t> indices_;
  std::vector<uint32_t> selected_;  // which ones, ascending; empty: all
  TriangleMesh mesh_;
  std::array<uint32_t, kUvSlots> slotSet_{kNone, kNone, kNone, kNone};  // the uv set that each slot holds
  ExtraAttributes extras_;
};

}  // namespace

TriangleMesh buildMesh(const Document& document, const MeshJob& job, Report& report) {
  try {
    return MeshBuilder(document, job, report).build();
  } catch (const std::bad_alloc&) {
    // A compressed mesh may claim any size.
    if (!isPacked(*job.primitive)) throw;
    report.problem(job.place, "needs more memory than there is; compress the file again", "it is left out");
    return {};
  }
}

int roundLevel(const Document& document, const std::vector<MeshJob>& jobs) {
  constexpr uint64_t kFew = uint64_t(1) << 23, kMost = uint64_t(1) << 25;
  // A few bytes of JSON may claim any number.
  const uint64_t most = std::min(kMost, (uint64_t(1) << 20) + 64 * document.sourceBytes);
  uint64_t points = 0, segments = 0;
  for (const MeshJob& job : jobs) {
    const Primitive& primitive = *job.primitive;
    const auto position = primitive.attributes.find("POSITION");
    if (primitive.mode < 0 || primitive.mode > 3 || position == primitive.attributes.end() || !(job.round.radius > 0))
      continue;
    const int counted = primitive.indices >= 0 ? primitive.indices : position->second;
    const uint64_t count = std::min(document.accessor(counted).count, size_t(1) << 40) * (1 + job.later.size());
    (primitive.mode == 0 ? points : segments) += primitive.mode == 1 ? count / 2 : count;
    if (points + segments > most) break;
  }
  const auto triangles = [&](int level) {
    return points * trianglesOfSphere(level) + segments * trianglesOfCapsule(level);
  };
  int level = 0;
  while (level + 1 < kRoundLevels && triangles(level) > std::min(kFew, most)) ++level;
  if (triangles(level) <= most) return level;
  throw SceneError(ExitCode::BadInput, document.path, "/meshes",
                   "points and lines are too many to be spheres and rods: " + std::to_string(most / 8) +
                       " points can be, or " + std::to_string(most / 12) +
                       " lines; leave some out, or render without --point-radius");
}

bool isPacked(const Primitive& primitive) { return primitive.extensions.contains("KHR_draco_mesh_compression"); }

}  // namespace braid::gltf
