// SPDX-License-Identifier: Apache-2.0
// Embree 3 and 4 differ in how a query gets its context; the few lines that do are marked by BRAID_EMBREE4.
#include "renderer/scene/accel.h"

#include <atomic>
#include <new>

#include "renderer/core/error.h"

#if RTC_VERSION_MAJOR >= 4
#define BRAID_EMBREE4 1
#endif

namespace braid {

namespace {

#ifdef BRAID_EMBREE4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// Embree hands the context back to the filter, so what a filter needs of the ray rides behind it.
struct Context {
  QueryContext embree;
  uint32_t salt;
};

bool countMemory(void* counter, ssize_t bytes, bool) {
  static_cast<std::atomic<int64_t>*>(counter)->fetch_add(bytes, std::memory_order_relaxed);
  return true;
}

RTCRay makeRay(const Vec3& o, const Vec3& d, float tmax) {
  RTCRay ray;
  ray.org_x = o.x;
  ray.org_y = o.y;
  ray.org_z = o.z;
  ray.tnear = 0;
  ray.dir_x = d.x;
  ray.dir_y = d.y;
  ray.dir_z = d.z;
  ray.time = 0;
  ray.tfar = tmax;
  ray.mask = ~0u;
  ray.id = 0;
  ray.flags = 0;
  return ray;
}

}  // namespace

struct Accel::FilterData {
  const HitFilter* filter;
  uint32_t mesh;
};

Accel::Accel() = default;

Accel::~Accel() {
  for (RTCScene s : groupScenes_) rtcReleaseScene(s);
  if (scene_) rtcReleaseScene(scene_);
  if (device_) rtcReleaseDevice(device_);
}

void Accel::checkError(const char* doing) const {
  const RTCError error = rtcGetDeviceError(device_);
  if (error == RTC_ERROR_NONE) return;
  if (error == RTC_ERROR_OUT_OF_MEMORY)
    throw Error(ExitCode::OutOfMemory, std::string("out of memory while ") + doing + ": reduce the scene or give the machine more memory");
  throw Error(ExitCode::Internal, std::string("Embree error ") + std::to_string(error) + " while " + doing);
}

RTCScene Accel::newScene() const {
  RTCScene scene = rtcNewScene(device_);
  rtcSetSceneBuildQuality(scene, highQuality_ ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM);
#ifdef BRAID_EMBREE4
  rtcSetSceneFlags(scene, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | (filter_ ? RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS : 0)));
#else
  rtcSetSceneFlags(scene, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST));
#endif
  return scene;
}

void Accel::attachMesh(RTCScene scene, uint32_t meshIndex, const AccelInput& input) {
  const TriangleMesh& mesh = (*input.meshes)[meshIndex];
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, highQuality_ ? RTC_BUILD_QUALITY_HIGH : RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0, sizeof(Vec3), mesh.positions.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0, sizeof(glm::uvec3), mesh.triangles.size());
  if (filter_ && (*input.filtered)[meshIndex]) {
    filterData_.push_back(std::make_unique<FilterData>(FilterData{filter_, meshIndex}));
    rtcSetGeometryUserData(geometry, filterData_.back().get());
    rtcSetGeometryIntersectFilterFunction(geometry, filterCallback);
    rtcSetGeometryOccludedFilterFunction(geometry, filterCallback);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

void Accel::build(const AccelInput& input, const HitFilter* filter) {
  BRAID_ASSERT(device_ == nullptr);
  std::atomic<int64_t> bytes{0};
  device_ = rtcNewDevice(input.isa.empty() ? nullptr : ("isa=" + input.isa).c_str());
  if (!device_) throw Error(ExitCode::Internal, "Embree cannot start: no supported instruction set");
  isa_ = input.isa.empty() ? "default" : input.isa;
  rtcSetDeviceMemoryMonitorFunction(device_, countMemory, &bytes);
  filter_ = filter;
  highQuality_ = input.highQuality;
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
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &instance.toWorld[0][0]);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    instanceGroup_.push_back(instance.group);
  }
  rtcCommitScene(scene_);
  checkError("building the ray acceleration structure");
  rtcSetDeviceMemoryMonitorFunction(device_, nullptr, nullptr);
  bytes_ = static_cast<size_t>(bytes.load());
}

void Accel::resolve(const RTCHit& from, RayHit& to) const {
  to.u = from.u;
  to.v = from.v;
  to.triangle = from.primID;
  if (from.instID[0] == RTC_INVALID_GEOMETRY_ID) {
    to.mesh = worldMeshes_[from.geomID];
    to.instance = kNoInstance;
  } else {
    to.instance = from.instID[0] - static_cast<uint32_t>(worldMeshes_.size());
    to.mesh = groups_[instanceGroup_[to.instance]].meshes[from.geomID];
  }
}

bool Accel::intersect(const Vec3& origin, const Vec3& direction, float tmax, uint32_t salt, RayHit& hit) const {
  Context context;
  context.salt = salt;
  RTCRayHit query;
  query.ray = makeRay(origin, direction, tmax);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#ifdef BRAID_EMBREE4
  rtcInitRayQueryContext(&context.embree);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context.embree;
  rtcIntersect1(scene_, &query, &arguments);
#else
  rtcInitIntersectContext(&context.embree);
  rtcIntersect1(scene_, &context.embree, &query);
#endif
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  hit.t = query.ray.tfar;
  resolve(query.hit, hit);
  return true;
}

bool Accel::occluded(const Vec3& origin, const Vec3& direction, float tmax, uint32_t salt) const {
  Context context;
  context.salt = salt;
  RTCRay ray = makeRay(origin, direction, tmax);
#ifdef BRAID_EMBREE4
  rtcInitRayQueryContext(&context.embree);
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context.embree;
  rtcOccluded1(scene_, &ray, &arguments);
#else
  rtcInitIntersectContext(&context.embree);
  rtcOccluded1(scene_, &context.embree, &ray);
#endif
  return ray.tfar < 0;
}

void Accel::filterCallback(const RTCFilterFunctionNArguments* args) {
  const auto* data = static_cast<const FilterData*>(args->geometryUserPtr);
  const auto* context = reinterpret_cast<const Context*>(args->context);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] != -1) continue;
    const Vec3 direction(RTCRayN_dir_x(args->ray, args->N, i), RTCRayN_dir_y(args->ray, args->N, i), RTCRayN_dir_z(args->ray, args->N, i));
    const Vec3 ng(RTCHitN_Ng_x(args->hit, args->N, i), RTCHitN_Ng_y(args->hit, args->N, i), RTCHitN_Ng_z(args->hit, args->N, i));
    // TRAP: inside an instance both the ray and Ng are in object space here; the sign is the same in world space, mirrored or not, because
    // normals transform by the inverse transpose.
    const bool backFace = glm::dot(direction, ng) > 0;
    if (data->filter->passThrough(data->mesh, RTCHitN_primID(args->hit, args->N, i), RTCHitN_u(args->hit, args->N, i),
                                  RTCHitN_v(args->hit, args->N, i), backFace, context->salt))
      args->valid[i] = 0;
  }
}

}  // namespace braid
