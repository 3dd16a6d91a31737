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

// What the filters of every query find: `crossed`, where they collect, has an entry a lane.
// TRAP: they read it from whatever context a query has, so that no query may have another.
struct FilterContext : QueryContext {
  explicit FilterContext(CrossedSurfaces* surfaces) : crossed(surfaces) { initialise(*this); }
  CrossedSurfaces* crossed;
};

#ifdef BRAID_EMBREE4
inline RTCIntersectArguments intersectArguments(FilterContext& context) {
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context;
  return arguments;
}
inline RTCOccludedArguments occludedArguments(FilterContext& context) {
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context;
  return arguments;
}
inline void embreeIntersect1(RTCScene scene, RTCRayHit& q, FilterContext context) {
  RTCIntersectArguments arguments = intersectArguments(context);
  rtcIntersect1(scene, &q, &arguments);
}
inline void embreeIntersect8(const int* valid, RTCScene scene, RTCRayHit8& q, FilterContext context) {
  RTCIntersectArguments arguments = intersectArguments(context);
  rtcIntersect8(valid, scene, &q, &arguments);
}
inline void embreeOccluded1(RTCScene scene, RTCRay& q, FilterContext context) {
  RTCOccludedArguments arguments = occludedArguments(context);
  rtcOccluded1(scene, &q, &arguments);
}
inline void embreeOccluded8(const int* valid, RTCScene scene, RTCRay8& q, FilterContext context) {
  RTCOccludedArguments arguments = occludedArguments(context);
  rtcOccluded8(valid, scene, &q, &arguments);
}
#else
inline void embreeIntersect1(RTCScene scene, RTCRayHit& q, FilterContext context) {
  rtcIntersect1(scene, &context, &q);
}
inline void embreeIntersect8(const int* valid, RTCScene scene, RTCRayHit8& q, FilterContext context) {
  rtcIntersect8(valid, scene, &context, &q);
}
inline void embreeOccluded1(RTCScene scene, RTCRay& q, FilterContext context) { rtcOccluded1(scene, &context, &q); }
inline void embreeOccluded8(const int* valid, RTCScene scene, RTCRay8& q, FilterContext context) {
  rtcOccluded8(valid, scene, &context, &q);
}
#endif

}  // namespace braid
