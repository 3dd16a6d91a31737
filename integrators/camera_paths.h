// SPDX-License-Identifier: Apache-2.0
// What integrators with camera subpaths do alike: the ray through a pixel, the features of what it sees, and the lights
// that it hits.
#pragma once

#include <optional>

#include "renderer/session/integrator.h"
#include "renderer/session/plan.h"
#include "renderer/transport/subpath.h"

namespace braid {

// What one camera path returns.
struct PathSample {
  Spectrum radiance{0};
  Spectrum direct{0};     // the direct part of it
  float coverage = 1;     // 0 when the camera ray misses everything
  bool onGround = false;  // of a shadow catcher: the radiance says how much of it is in shadow
  FeatureSample features;
  float leastLobe = 1;  // the least probability of the delta lobes that led to what the features describe
};

// The ray of a sample of pixel (x, y) of the full frame at a time; its place in the pixel follows the plan's filter.
// `camera` is block 0 of the sample's random numbers.
Camera::CameraRay cameraRayThrough(const Plan& plan, const SampleBlock& camera, int x, int y, float time);

// The features of a surface seen after `distance` metres: the one place that fills them, but for visibility.
void surfaceFeatures(const Scene& scene, const Hit& hit, const Bsdf& bsdf, float distance, FeatureSample& features);
void unlitFeatures(const Spectrum& color, const Hit& hit, float distance, FeatureSample& features);

// Records a vertex as the first that is not specular, or as the last of its path; false when it is neither.
bool recordFeatures(const Scene& scene, const SubpathVertex& vertex, int maxDepth, PathSample& sample);

// Records an unlit surface and returns its colour, which only the camera and mirrors see.
Spectrum unlitColor(const Scene& scene, const SubpathVertex& vertex, bool record, PathSample& sample);

// A light of LightSampler that a path hits, so that light sampling may have found it as well.
struct LightHit {
  uint32_t light;
  float cosine;  // at the light
};
std::optional<LightHit> lightAt(const Scene& scene, const Hit& hit);

// What a ray that leaves the scene brings into the sample of its path. `record`: it has seen nothing to record before,
// and has come over delta lobes of that least probability.
Spectrum radianceBeyond(const Scene& scene, const Plan& plan, const Vec3& direction, bool fromCamera, bool record,
                        float leastLobe, PathSample& sample);

}  // namespace braid
