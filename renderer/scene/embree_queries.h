// SPDX-License-Identifier: Apache-2.0
// Embree's queries. Versions 3 and 4 differ only in how a query gets its context.
#pragma once

#include "renderer/scene/accel.h"
#include "renderer/scene/crossed_surfaces.h"

#if RTC_VERSION_MAJOR >= 4
#define BRAID_EMBREE4 1
#endif

namespace braid {

#ifdef BRAID_EMBREE4
using QueryContext = RTCRayQueryContext;
inline void initialise(QueryContext& context) { rtcInitRayQueryContext(&context); }
#else
using QueryContext = RTCIntersectContext;
inline void initialise(QueryContext& context) { rtcInitIntersectContext(&context); }
#endif

// What the filter of a query for occlusion finds: `crossed`, where it collects, has an entry a lane.
struct OcclusionContext : QueryContext {
  explicit OcclusionContext(CrossedSurfaces* surfaces) : crossed(surfaces) { initialise(*this); }
  CrossedSurfaces* crossed;
};

#ifdef BRAID_EMBREE4
inline void embreeIntersect1(RTCScene scene, RTCRayHit& q) { rtcIntersect1(scene, &q, nullptr); }
inline void embreeIntersect8(const int* valid, RTCScene scene, RTCRayHit8& q) {
  rtcIntersect8(valid, scene, &q, nullptr);
}
inline RTCOccludedArguments argumentsOf(OcclusionContext& context) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  return arguments;
}
inline void embreeOccluded1(RTCScene scene, RTCRay& q, CrossedSurfaces* crossed) {
  OcclusionContext context(crossed);
  RTCOccludedArguments arguments = argumentsOf(context);
  rtcOccluded1(scene, &q, &arguments);
}
inline void embreeOccluded8(const int* valid, RTCScene scene, RTCRay8& q, CrossedSurfaces* crossed) {
  OcclusionContext context(crossed);
  RTCOccludedArguments arguments = argumentsOf(context);
  rtcOccluded8(valid, scene, &q, &arguments);
}
#else
inline void embreeIntersect1(RTCScene scene, RTCRayHit& q) {
  QueryContext context;
  initialise(context);
  rtcIntersect1(scene, &context, &q);
}
inline void embreeIntersect8(const int* valid, RTCScene scene, RTCRayHit8& q) {
  QueryContext context;
  initialise(context);
  rtcIntersect8(valid, scene, &context, &q);
}
inline void embreeOccluded1(RTCScene scene, RTCRay& q, CrossedSurfaces* crossed) {
  OcclusionContext context(crossed);
  rtcOccluded1(scene, &context, &q);
}
inline void embreeOccluded8(const int* valid, RTCScene scene, RTCRay8& q, CrossedSurfaces* crossed) {
  OcclusionContext context(crossed);
  rtcOccluded8(valid, scene, &context, &q);
}
#endif

}  // namespace braid
