// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/accel.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <new>

#include "renderer/core/error.h"
#include "renderer/scene/coincident.h"
#include "renderer/scene/embree_queries.h"

namespace braid {

namespace {

bool countMemory(void* counter, ssize_t bytes, bool) {
  static_cast<std::atomic<int64_t>*>(counter)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

RTCRay singleRay(const RayQuery& r) {
  RTCRay ray;
  ray.org_x = r.origin.x;
  ray.org_y = r.origin.y;
  ray.org_z = r.origin.z;
  ray.tnear = 0;
  ray.dir_x = r.direction.x;
  ray.dir_y = r.direction.y;
  ray.dir_z = r.direction.z;
  ray.time = r.time;
  ray.tfar = r.tmax;
  ray.mask = ~0u;
  ray.id = r.salt;
  ray.flags = 0;
  return ray;
}

bool isBackFace(const RTCFilterFunctionNArguments* args, unsigned i) {
  const Vec3 direction(RTCRayN_dir_x(args->ray, args->N, i), RTCRayN_dir_y(args->ray, args->N, i),
                       RTCRayN_dir_z(args->ray, args->N, i));
  const Vec3 ng(RTCHitN_Ng_x(args->hit, args->N, i), RTCHitN_Ng_y(args->hit, args->N, i),
                RTCHitN_Ng_z(args->hit, args->N, i));
  // TRAP: inside an instance both the ray and Ng are in object space here; the sign is the same in world space,
  // mirrored or not, because normals transform by the inverse transpose.
  return glm::dot(direction, ng) > 0;
}

}  // namespace

struct Accel::FilterData {
  const HitFilter* filter;
  uint32_t mesh;
};

Accel::Accel() = default;

Accel::~Accel() {
  for (RTCScene s : groupScenes_) rtcReleaseScene(s);
  if (coincidentScene_) rtcReleaseScene(coincidentScene_);
  if (scene_) rtcReleaseScene(scene_);
  if (device_) rtcReleaseDevice(device_);
}

void Accel::checkError(const char* doing) const {
  const RTCError error = rtcGetDeviceError(device_);
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    throw Error(ExitCode::OutOfMemory,
                std::string("out of memory while ") + doing + ": reduce the scene or give the machine more memory");
  throw Error(ExitCode::Internal, std::string("Embree error ") + std::to_string(error) + " while " + doing);
}

RTCScene Accel::newScene() const {
  RTCScene scene = rtcNewScene(device_);
  rtcSetSceneBuildQuality(scene, highQuality_ ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // watertight
  return scene;
}

void Accel::attachMesh(RTCScene scene, uint32_t meshIndex, const AccelInput& input) {
  const TriangleMesh& mesh = (*input.meshes)[meshIndex];
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, highQuality_ ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM);
  if (mesh.moves()) rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(mesh.steps.size() + 1));
  for (unsigned k = 0; k <= mesh.steps.size(); ++k)
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, k, RTC_FORMAT_FLOAT3, mesh.step(k).positions.data(), 0,
                               sizeof(Vec3), mesh.positions.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             sizeof(glm::uvec3), mesh.triangles.size());
  if (filter_ && (*input.filtered)[meshIndex]) {
    filterData_.push_back(std::make_unique<FilterData>(FilterData{filter_, meshIndex}));
    rtcSetGeometryUserData(geometry, filterData_.back().get());
    rtcSetGeometryIntersectFilterFunction(geometry, filterCallback);
    rtcSetGeometryOccludedFilterFunction(geometry, occlusionCallback);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

void Accel::build(const AccelInput& input, const HitFilter* filter) {
  BRAID_ASSERT(device_ == nullptr);
  std::atomic<int64_t> bytes{0};
  device_ = rtcNewDevice(input.isa.empty() ? nullptr : ("isa=" + input.isa).c_str());
  if (!device_) {
    if (rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY)
      throw Error(ExitCode::OutOfMemory, "out of memory while starting Embree: raise the limit of memory");
    throw Error(ExitCode::Internal, "Embree cannot start: no supported instruction set");
  }
  isa_ = input.isa.empty() ? "default" : input.isa;
  rtcSetDeviceMemoryMonitorFunction(device_, countMemory, &bytes);
  filter_ = filter;
  coincident_ = input.coincident && input.coincident->any() ? input.coincident : nullptr;
  highQuality_ = input.highQuality;
  packets_ = rtcGetDeviceProperty(device_, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  worldMeshes_ = *input.worldMeshes;
  groups_ = *input.groups;

  for (const MeshGroup& group : groups_) {
    RTCScene scene = newScene();
    for (uint32_t mesh : group.meshes) attachMesh(scene, mesh, input);
    rtcCommitScene(scene);
    groupScenes_.push_back(scene);
  }
  scene_ = newScene();
  for (uint32_t mesh : worldMeshes_) attachMesh(scene_, mesh, input);
  for (const GroupInstance& instance : *input.instances) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, groupScenes_[instance.group]);
    if (instance.motion == GroupInstance::kStill) {
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &instance.toWorld[0][0]);
    } else {
      const std::vector<Mat4>& steps = (*input.motions)[instance.motion];
      rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(steps.size()));
      for (unsigned k = 0; k < steps.size(); ++k)
        rtcSetGeometryTransform(geometry, k, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &steps[k][0][0]);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    instanceGroup_.push_back(instance.group);
  }
  rtcCommitScene(scene_);
  if (coincident_) buildCoincident();
  checkError("building the ray acceleration structure");
  rtcSetDeviceMemoryMonitorFunction(device_, nullptr, nullptr);
  bytes_ = static_cast<size_t>(bytes.load());
}

void Accel::resolve(uint32_t geometry, uint32_t instance, RayHit& hit) const {
  if (instance == RTC_INVALID_GEOMETRY_ID) {
    hit.mesh = worldMeshes_[geometry];
    hit.instance = kNoInstance;
  } else {
    hit.instance = instance - static_cast<uint32_t>(worldMeshes_.size());
    hit.mesh = groups_[instanceGroup_[hit.instance]].meshes[geometry];
  }
}

void Accel::intersect(RayBatch& rays, int count, RayHit* hits) const {
  for (int first = 0; first < count; first += kPacket)
    intersectPacket(rays, first, std::min(kPacket, count - first), hits, nullptr);
}

void Accel::intersect(RayBatch& rays, int count, RayHit* hits, float* passing) const {
  for (int first = 0; first < count; first += kPacket) {
    const int lanes = std::min(kPacket, count - first);
    std::array<CrossedSurfaces, kPacket> crossed;
    intersectPacket(rays, first, lanes, hits, crossed.data());
    for (int i = 0; i < lanes; ++i) passing[first + i] = crossed[static_cast<size_t>(i)].passing(hits[first + i].t);
  }
}

// `crossed`: null, or one a lane.
void Accel::intersectPacket(RayBatch& rays, int first, int lanes, RayHit* hits, CrossedSurfaces* crossed) const {
  if (!packets_ || lanes == 1) {
    for (int i = 0; i < lanes; ++i)
      intersectSingle(rays.get(first + i), hits[first + i], crossed ? crossed + i : nullptr);
    return;
  }
  RTCRayHit8& query = rays.packet(first);
  alignas(32) int valid[kPacket];
  for (int i = 0; i < kPacket; ++i) {
    valid[i] = i < lanes ? -1 : 0;
    query.hit.geomID[i] = query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  embreeIntersect8(valid, scene_, query, FilterContext(crossed));
  for (int i = 0; i < lanes; ++i) {
    RayHit& hit = hits[first + i];
    const bool found = query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    hit.t = found ? query.ray.tfar[i] : kInfinity;
    if (!found) continue;
    hit.u = query.hit.u[i];
    hit.v = query.hit.v[i];
    hit.triangle = query.hit.primID[i];
    hit.time = query.ray.time[i];
    resolve(query.hit.geomID[i], query.hit.instID[0][i], hit);
    if (coincident_) preferFacing(rays.get(first + i), {query.hit.Ng_x[i], query.hit.Ng_y[i], query.hit.Ng_z[i]}, hit);
  }
}

void Accel::intersectSingle(const RayQuery& ray, RayHit& hit, CrossedSurfaces* crossed) const {
  RTCRayHit query;
  query.ray = singleRay(ray);
  query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embreeIntersect1(scene_, query, FilterContext(crossed));
  hit.t = kInfinity;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  hit.t = query.ray.tfar;
  hit.u = query.hit.u;
  hit.v = query.hit.v;
  hit.triangle = query.hit.primID;
  hit.time = ray.time;
  resolve(query.hit.geomID, query.hit.instID[0], hit);
  if (coincident_) preferFacing(ray, {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z}, hit);
}

void Accel::buildCoincident() {
  coincidentScene_ = newScene();
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  const CoincidentFaces& faces = *coincident_;
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, faces.corners().data(), 0,
                             sizeof(Vec3), faces.corners().size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, faces.triangles().data(), 0,
                             sizeof(glm::uvec3), faces.triangles().size());
  rtcSetGeometryUserData(geometry, this);
  rtcSetGeometryIntersectFilterFunction(geometry, coincidentCallback);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(coincidentScene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(coincidentScene_);
}

void Accel::preferFacing(const RayQuery& ray, const Vec3& ng, RayHit& hit) const {
  if (hit.instance == kNoInstance && !(glm::dot(ray.direction, ng) > 0)) return;
  const float reach = coincident_->reach(ray, hit);
  if (!(reach > 0)) return;
  RTCRayHit query;
  query.ray = singleRay(ray);
  query.ray.tnear = std::max(0.0f, hit.t - reach);
  query.ray.tfar = hit.t + reach;
  query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embreeIntersect1(coincidentScene_, query, FilterContext(nullptr));
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  const CoincidentFaces::Face& face = coincident_->faces()[query.hit.primID];
  const RayHit found{query.ray.tfar, query.hit.u, query.hit.v, face.mesh, face.triangle, face.instance, hit.time};
  if (coincident_->pairs(hit, found)) hit = found;
}

// Lets rays meet what faces them, unless they pass through it.
void Accel::coincidentCallback(const RTCFilterFunctionNArguments* args) {
  const auto* accel = static_cast<const Accel*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    const CoincidentFaces::Face& face = accel->coincident_->faces()[RTCHitN_primID(args->hit, args->N, i)];
    const bool passes =
        accel->filter_ &&
        accel->filter_->passThrough(face.mesh, face.triangle, RTCHitN_u(args->hit, args->N, i),
                                    RTCHitN_v(args->hit, args->N, i), false, RTCRayN_id(args->ray, args->N, i));
    if (passes || isBackFace(args, i) != face.mirrored) args->valid[i] = 0;
  }
}

void Accel::occluded(ShadowBatch& rays, int count, bool* results) const {
  for (int first = 0; first < count; first += kPacket)
    occludedPacket(rays, first, std::min(kPacket, count - first), results, nullptr);
}

void Accel::occluded(ShadowBatch& rays, int count, bool* results, float* passing) const {
  for (int first = 0; first < count; first += kPacket) {
    const int lanes = std::min(kPacket, count - first);
    std::array<CrossedSurfaces, kPacket> crossed;
    occludedPacket(rays, first, lanes, results, crossed.data());
    for (int i = 0; i < lanes; ++i) passing[first + i] = crossed[static_cast<size_t>(i)].passing(kInfinity);
  }
}

// `crossed`: null, or one a lane.
void Accel::occludedPacket(ShadowBatch& rays, int first, int lanes, bool* results, CrossedSurfaces* crossed) const {
  if (!packets_ || lanes == 1) {
    for (int i = 0; i < lanes; ++i) {
      RTCRay ray = singleRay(rays.get(first + i));
      embreeOccluded1(scene_, ray, FilterContext(crossed ? crossed + i : nullptr));
      results[first + i] = ray.tfar < 0;
    }
    return;
  }
  RTCRay8& query = rays.packet(first);
  alignas(32) int valid[kPacket];
  for (int i = 0; i < kPacket; ++i) valid[i] = i < lanes ? -1 : 0;
  embreeOccluded8(valid, scene_, query, FilterContext(crossed));
  for (int i = 0; i < lanes; ++i) results[first + i] = query.tfar[i] < 0;
}

void Accel::filterCallback(const RTCFilterFunctionNArguments* args) {
  if (CrossedSurfaces* crossed = static_cast<const FilterContext*>(args->context)->crossed)
    return collectCrossed(args, crossed, false);
  const auto* data = static_cast<const FilterData*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    if (data->filter->passThrough(data->mesh, RTCHitN_primID(args->hit, args->N, i), RTCHitN_u(args->hit, args->N, i),
                                  RTCHitN_v(args->hit, args->N, i), isBackFace(args, i),
                                  RTCRayN_id(args->ray, args->N, i)))
      args->valid[i] = 0;
  }
}

void Accel::occlusionCallback(const RTCFilterFunctionNArguments* args) {
  if (CrossedSurfaces* crossed = static_cast<const FilterContext*>(args->context)->crossed)
    return collectCrossed(args, crossed, true);
  filterCallback(args);
}

// Rays pass what is covered in part, and keep it; panes stop them where they are not to be kept.
void Accel::collectCrossed(const RTCFilterFunctionNArguments* args, CrossedSurfaces* crossed, bool panesToo) {
  const auto* data = static_cast<const FilterData*>(args->geometryUserPtr);
  const bool keeps = panesToo || !data->filter->mayBePane(data->mesh);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    const uint32_t triangle = RTCHitN_primID(args->hit, args->N, i),
                   instance = RTCHitN_instID(args->hit, args->N, i, 0);
    const float u = RTCHitN_u(args->hit, args->N, i), v = RTCHitN_v(args->hit, args->N, i),
                t = RTCRayN_tfar(args->ray, args->N, i);
    const float passing =
        data->filter->passing(data->mesh, triangle, u, v, isBackFace(args, i), RTCRayN_id(args->ray, args->N, i));
    const bool kept = passing > 0 && keeps && crossed[i].add(instance, data->mesh, triangle, u, v, t, passing);
    if (passing >= 1 || kept) args->valid[i] = 0;
  }
}

}  // namespace braid
