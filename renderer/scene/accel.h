// SPDX-License-Identifier: Apache-2.0
// Ray queries by Embree over shared vertex and index buffers; single-level instances; an any-hit filter only for
// surfaces that need one.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/data/material.h"
#include "renderer/scene/data/scene_data.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace braid {

inline constexpr uint32_t kNoInstance = ~0u;

// Bit of RayQuery::salt: a camera ray, the only kind that back faces of single-sided surfaces let pass.
inline constexpr uint32_t kCameraRay = 1;

// A ray; `direction` need not be unit, t is in units of its length. `salt` makes stochastic coverage differ between
// rays; its lowest bit is kCameraRay.
struct RayQuery {
  Vec3 origin, direction;
  float tmax = kInfinity;
  uint32_t salt = 0;
  float time = 0;  // while the shutter is open (motion.h)
};

struct RayHit {
  float t = kInfinity;
  float u = 0, v = 0;  // barycentric weights of the second and third vertex
  uint32_t mesh = 0;   // index into the scene's meshes
  uint32_t triangle = 0;
  uint32_t instance =
      kNoInstance;  // index into the scene's instances, or kNoInstance when the mesh lies in world space
  float time = 0;   // of the ray
};

// Rays are traced in packets of kPacket: also for unrelated rays that is faster than one at a time (0.74x the time in a
// room of 38 triangles, 0.95x in one of a million), because a packet shares the work of the upper hierarchy.
inline constexpr int kPacket = 8;
// So many that few packets are partly filled, so few that the caches hold them.
inline constexpr int kBatch = 128;

// Up to kBatch rays in Embree's own layout. Rays are written one by one as they come up, long before they are traced: a
// packet filled just before its use would stall, because Embree loads eight lanes at once where single floats were
// stored a moment ago.
template <class Packet>
class PacketBatch {
 public:
  void set(int i, const RayQuery& r) {
    RTCRay8& q = ray(packets_[static_cast<size_t>(i / kPacket)]);
    const int lane = i % kPacket;
    q.org_x[lane] = r.origin.x;
    q.org_y[lane] = r.origin.y;
    q.org_z[lane] = r.origin.z;
    q.tnear[lane] = 0;
    q.dir_x[lane] = r.direction.x;
    q.dir_y[lane] = r.direction.y;
    q.dir_z[lane] = r.direction.z;
    q.time[lane] = r.time;
    q.tfar[lane] = r.tmax;
    q.mask[lane] = ~0u;
    q.id[lane] = r.salt;  // handed back to the filter
    q.flags[lane] = 0;
  }
  RayQuery get(int i) const {
    const RTCRay8& q = ray(const_cast<Packet&>(packets_[static_cast<size_t>(i / kPacket)]));
    const int l = i % kPacket;
    return {{q.org_x[l], q.org_y[l], q.org_z[l]}, {q.dir_x[l], q.dir_y[l], q.dir_z[l]}, q.tfar[l], q.id[l], q.time[l]};
  }
  Packet& packet(int first) { return packets_[static_cast<size_t>(first / kPacket)]; }

 private:
  static RTCRay8& ray(RTCRayHit8& p) { return p.ray; }
  static RTCRay8& ray(RTCRay8& p) { return p; }
  std::array<Packet, kBatch / kPacket> packets_{};
};
using RayBatch = PacketBatch<RTCRayHit8>;
using ShadowBatch = PacketBatch<RTCRay8>;

// How meshes are placed: directly in the top level, or in groups that share one bounding hierarchy.
struct MeshGroup {
  std::vector<uint32_t> meshes;
};
struct GroupInstance {
  static constexpr uint32_t kStill = ~0u;
  uint32_t group = 0;
  uint32_t motion = kStill;  // index into a list of transforms at the steps 0, 1, … of the scene's motion
  Mat4 toWorld{1};
  Mat4 toObject{1};
};

class CoincidentFaces;
class CrossedSurfaces;

struct AccelInput {
  const std::vector<TriangleMesh>* meshes = nullptr;
  const std::vector<uint8_t>* filtered = nullptr;  // per mesh: needs the any-hit filter
  const std::vector<uint32_t>* worldMeshes = nullptr;
  const std::vector<MeshGroup>* groups = nullptr;
  const std::vector<GroupInstance>* instances = nullptr;
  const std::vector<std::vector<Mat4>>* motions = nullptr;  // that instances refer to
  std::string isa;                                          // e.g. "avx2"; empty: Embree's choice
  bool highQuality = true;                                  // spatial splits
  const CoincidentFaces* coincident = nullptr;
};

// Decides whether a ray passes through a candidate hit (alpha, culled back faces). `salt` makes stochastic decisions
// differ between rays.
class HitFilter {
 public:
  virtual ~HitFilter() = default;
  virtual bool passThrough(uint32_t mesh, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const = 0;
  // The probability that it does, over all salts of such rays.
  virtual float passing(uint32_t mesh, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const = 0;
  virtual bool mayBePane(uint32_t mesh) const = 0;
};

class Accel {
 public:
  Accel();
  ~Accel();
  Accel(const Accel&) = delete;
  Accel& operator=(const Accel&) = delete;

  // Builds the hierarchies; vertex and index buffers must outlive the Accel. Throws Error(OutOfMemory / Internal).
  void build(const AccelInput& input, const HitFilter* filter);

  // Traces the first `count` rays of the batch; hits[i].t is infinity where ray i misses. Consumes the rays.
  // TRAP: not as frusta (Embree's coherent rays), although camera rays would be faster: of two surfaces in one place
  // they meet another one than single rays do, and then paths from the camera and from lights see different scenes.
  void intersect(RayBatch& rays, int count, RayHit* hits) const;
  // The same where what is covered in part, but for panes, lets its share of the light pass instead of some of the
  // rays: passing[i] is the share of ray i that is left at its hit. After CrossedSurfaces::kMost such surfaces the next
  // one is the hit.
  void intersect(RayBatch& rays, int count, RayHit* hits, float* passing) const;
  // results[i] = whether anything lies in (0, tmax) of ray i. Consumes the rays.
  void occluded(ShadowBatch& rays, int count, bool* results) const;
  // The same where partly covered surfaces let their share of the light pass instead of some of the rays:
  // passing[i] is the share of ray i that is left, unless something hides it.
  void occluded(ShadowBatch& rays, int count, bool* results, float* passing) const;

  // Bytes that Embree holds (hierarchies, not the shared buffers).
  size_t bytes() const { return bytes_; }
  const std::string& isa() const { return isa_; }
  RTCScene handle() const { return scene_; }
  bool filtered() const { return filter_ != nullptr; }

 private:
  RTCScene newScene() const;
  void attachMesh(RTCScene scene, uint32_t mesh, const AccelInput& input);
  void intersectPacket(RayBatch& rays, int first, int lanes, RayHit* hits, CrossedSurfaces* crossed) const;
  void intersectSingle(const RayQuery& ray, RayHit& hit, CrossedSurfaces* crossed) const;
  void occludedPacket(ShadowBatch& rays, int first, int lanes, bool* results, CrossedSurfaces* crossed) const;
  // Replaces a hit from behind by that of a face in the same place that faces the ray. `ng` is the hit's normal in the
  // coordinates of its mesh.
  void preferFacing(const RayQuery& ray, const Vec3& ng, RayHit& hit) const;
  void buildCoincident();
  void resolve(uint32_t geometry, uint32_t instance, RayHit& hit) const;
  void checkError(const char* doing) const;

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::vector<RTCScene> groupScenes_;
  const HitFilter* filter_ = nullptr;
  const CoincidentFaces* coincident_ = nullptr;
  RTCScene coincidentScene_ = nullptr;  // its faces alone
  size_t bytes_ = 0;
  std::string isa_;
  bool highQuality_ = true;
  bool packets_ = true;  // the device traces packets of kPacket natively

  // Top-level geometry id → mesh (world meshes come first, in order) or instance; group geometry id → mesh.
  std::vector<uint32_t> worldMeshes_;
  std::vector<MeshGroup> groups_;
  std::vector<uint32_t> instanceGroup_;

  struct FilterData;  // per Embree geometry, for the callback
  std::vector<std::unique_ptr<FilterData>> filterData_;
  static void filterCallback(const RTCFilterFunctionNArguments* args);
  static void collectCrossed(const RTCFilterFunctionNArguments* args, CrossedSurfaces* crossed, bool panesToo);
  static void occlusionCallback(const RTCFilterFunctionNArguments* args);
  static void coincidentCallback(const RTCFilterFunctionNArguments* args);
};

}  // namespace braid
