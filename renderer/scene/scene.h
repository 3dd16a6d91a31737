// SPDX-License-Identifier: Apache-2.0
// The immutable scene that integrators see: geometry with its ray acceleration structure, materials, lights, and what
// it contains (traits).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/accel.h"
#include "renderer/scene/coincident.h"
#include "renderer/scene/data/emitters.h"
#include "renderer/scene/data/motion.h"
#include "renderer/scene/environment.h"
#include "renderer/scene/data/scene_data.h"
#include "renderer/scene/traits.h"

namespace braid {

struct SceneOptions {
  std::string isa;                  // Embree instruction set, e.g. "avx2"; empty: Embree's choice
  bool full = false;                // no pruning: filters on every mesh
  std::optional<bool> highQuality;  // spatial splits in the hierarchies; none: up to 4 million triangles
};

// Seconds spent building, for reports.
struct BuildTimes {
  double prepare = 0, hierarchy = 0;
};

class Scene : private HitFilter {
 public:
  explicit Scene(SceneData data, const SceneOptions& options = {});
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Lights a dark scene by giveDefaultLight(), and keeps the warning that says so. Before anything is planned or
  // rendered.
  void addDefaultLight(DefaultLight kind, float scale, const std::string& warning);

  const SceneData& data() const { return data_; }
  const std::vector<TriangleMesh>& meshes() const { return data_.meshes; }
  const std::vector<Material>& materials() const { return data_.materials; }
  const std::vector<Texture>& textures() const { return data_.textures; }
  const std::vector<PunctualLight>& lights() const { return data_.lights; }
  const std::optional<Environment>& environment() const { return environment_; }
  const std::vector<EmissiveTriangle>& emitters() const { return emitters_; }
  const std::vector<GroupInstance>& instances() const { return instances_; }
  const Accel& accel() const { return accel_; }
  const SceneTraits& traits() const { return traits_; }
  const Bounds& bounds() const { return bounds_; }
  const BuildTimes& buildTimes() const { return times_; }

  const TriangleMesh& mesh(uint32_t i) const { return data_.meshes[i]; }
  const Material& material(const TriangleMesh& mesh) const { return data_.materials[mesh.material]; }

  // Index into emitters() of a hit triangle, or -1.
  int64_t emitterIndex(uint32_t mesh, uint32_t triangle, uint32_t instance) const;
  // Radiance leaving an emissive surface at a uv-interpolated point of a triangle with barycentric weights (1-u-v, u,
  // v).
  Spectrum emission(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const;
  // emission() times alpha(): what a point chosen on the surface sends on average, for light sampling. A ray that hits
  // the surface has already decided the coverage.
  Spectrum coveredEmission(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const;
  // Coverage of a surface point in [0,1] (alpha mode OPAQUE: 1).
  float alpha(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const;

  // Whether anything is elsewhere while the shutter is open than at its opening, the camera included.
  bool moves() const { return data_.motion.any(); }
  // The time of a path that is traced when this share of the shutter's seconds has gone by.
  float timeAt(float share) const { return shutterTime(data_.motion, share); }
  // An instance and an emitter at a time; those that stand still are returned, others put into `moved`.
  const GroupInstance& instanceAt(uint32_t instance, float time, GroupInstance& moved) const {
    const GroupInstance& still = instances_[instance];
    return still.motion == GroupInstance::kStill ? still : moveInstance(still, time, moved);
  }
  const EmissiveTriangle& emitterAt(size_t emitter, float time, EmissiveTriangle& moved) const {
    const EmissiveTriangle& still = emitters_[emitter];
    return still.moves ? moveEmitter(still, time, moved) : still;
  }
  // Where an emitter is while the shutter is open.
  struct Sweep {
    Bounds bounds;
    bool turns = false;  // its normal is not always the same
  };
  Sweep sweepOf(const EmissiveTriangle& emitter) const;

  // Bytes of vertices, indices and textures (without Embree's own).
  size_t geometryBytes() const;
  size_t textureBytes() const;

  Vec4 lookup(const TextureRef& ref, const TriangleMesh& mesh, uint32_t triangle, float u, float v) const;

 private:
  bool passThrough(uint32_t mesh, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const override;
  float passing(uint32_t mesh, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const override;
  bool mayBePane(uint32_t mesh) const override { return material(data_.meshes[mesh]).mayBePane(); }
  void separateUnfit();
  void placeMeshes();
  void placeGroups(const std::vector<uint32_t>& shared, const std::vector<std::vector<size_t>>& placements);
  void findBounds();
  void findExtinctions();
  const GroupInstance& moveInstance(const GroupInstance& instance, float time, GroupInstance& moved) const;
  const EmissiveTriangle& moveEmitter(const EmissiveTriangle& emitter, float time, EmissiveTriangle& moved) const;
  void averageOverSteps(EmissiveTriangle& emitter) const;
  void markFilteredMeshes(bool full);
  void collectEmitters();
  void appendEmitters(uint32_t mesh, uint32_t instance);
  void detectTraits();

  SceneData data_;
  std::optional<Environment> environment_;
  std::vector<uint32_t> worldMeshes_;
  std::vector<MeshGroup> groups_;
  std::vector<GroupInstance> instances_;
  std::vector<std::vector<Mat4>> motions_;  // of instances, at the steps 0, 1, …
  std::vector<uint8_t> filtered_;           // per mesh
  std::vector<uint8_t> reachableBacks_;     // per mesh: rays may meet its back faces
  std::vector<uint8_t> opaque_;             // per mesh: no light passes its surface, but through holes
  std::vector<EmissiveTriangle> emitters_;
  std::vector<int64_t> meshEmitterBase_;  // per world mesh index: first emitter or -1
  std::vector<std::vector<int64_t>>
      instanceEmitterBase_;  // per instance, per mesh of its group (empty when none emits)
  Bounds bounds_;
  SceneTraits traits_;
  BuildTimes times_;
  std::optional<CoincidentFaces> coincident_;
  Accel accel_;
};

// Interpolates a per-vertex attribute at barycentric weights (1-u-v, u, v).
template <class T>
T interpolate(const std::vector<T>& attribute, const glm::uvec3& triangle, float u, float v) {
  return attribute[triangle.x] * (1 - u - v) + attribute[triangle.y] * u + attribute[triangle.z] * v;
}

// The shape of an emissive triangle from its corners in the world; `mirrored`: its front is where they turn clockwise.
void setShape(EmissiveTriangle& emitter, const Vec3* corners, bool mirrored);

}  // namespace braid
