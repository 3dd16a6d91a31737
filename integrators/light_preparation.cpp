// SPDX-License-Identifier: Apache-2.0
#include "integrators/light_preparation.h"

#include <algorithm>
#include <cmath>

namespace braid {

namespace {

// The unit of splats follows the irradiance that the lights would give on the scene's sphere, so that scaling all
// lights by a power of two scales the image and nothing else.
int fractionBits(double power, double radius) {
  const double irradiance = power / (4 * static_cast<double>(kPi) * radius * radius);
  if (!(irradiance > 0) || !std::isfinite(irradiance)) return 32;
  return std::clamp(32 - static_cast<int>(std::floor(std::log2(irradiance))), -60, 120);
}

}  // namespace

LightPreparation::LightPreparation(const TransportContext& context) : emission(context.scene, context.lights) {
  splatFractionBits = fractionBits(emission.power(), static_cast<double>(context.scene.traits().radius));
}

LightPreparation::Ref::Ref(const PassRequest& request) {
  used_ = dynamic_cast<const LightPreparation*>(request.preparation);
  if (used_) return;
  own_ = std::make_unique<LightPreparation>(request.context);
  used_ = own_.get();
}

Applies lightPathsApply(const SceneTraits& traits) {
  if (!traits.has(kTraitEmissiveTriangles | kTraitPointLights | kTraitDirectionalLights))
    return {false, "only the environment lights the scene: eye paths find it"};
  if (!traits.has(kTraitSmoothSpecular | kTraitTransmission))
    return {false, "no smooth or transmissive surface can focus light into a caustic"};
  return {true, "finite lights and surfaces that can cast caustics"};
}

MediaStack mediaOfCamera(const Scene& scene, const Camera& camera) {
  return scene.traits().has(kTraitVolume) ? mediaAround(scene, camera.position(), camera.forward()) : MediaStack();
}

}  // namespace braid
