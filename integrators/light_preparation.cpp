// SPDX-License-Identifier: Apache-2.0
#include "integrators/light_preparation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace braid {

namespace {

// Where photons pay: where camera paths find caustics by rare chance only. Where lamps are merely hidden, camera paths
// are noisy everywhere alike, which is what filters are good at (combiners/EXPERIMENTS.md, Where photons and
// connections pay).
constexpr double kCausticVariance = 10;
// Of the light in view; with fewer there is nothing to tell.
constexpr double kFewCaustics = 0.001;
// Connections cost more than camera paths: beside a photon map they pay where caustics that are met by chance are much
// of the light. Where camera paths cannot meet some light at all, the unbiased image needs them.
constexpr double kCausticShare = 0.04;
constexpr double kUnreachableShare = 0.001;
// Of all light, that media bring from lights without size.
constexpr double kMediaShare = 0.01;

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

Applies photonsApply(const SceneTraits& traits, const LightReach& reach) {
  if (!traits.has(kTraitEmissiveTriangles | kTraitPointLights | kTraitDirectionalLights))
    return {false, "only the environment lights the scene: camera paths find it"};
  if (reach.causticVariance > kCausticVariance)
    return {true,
            fmt::format("caustics are {:.2g} % of the light in view and would give camera paths {:.2g} times the "
                        "variance of all the rest",
                        100 * reach.caustic, reach.causticVariance),
            true};
  return {false, reach.caustic < kFewCaustics
                     ? fmt::format("no caustics to speak of ({:.2g} % of the light in view)", 100 * reach.caustic)
                     : fmt::format("caustics are {:.2g} % of the light in view, and camera paths find them",
                                   100 * reach.caustic)};
}

Applies connectionsApply(const SceneTraits& traits, const LightReach& reach) {
  if (reach.throughMedia >= kMediaShare)
    return {true,
            fmt::format("{:.2g} % of the light in view comes from lights without size through media that scatter: "
                        "no camera path finds it",
                        100 * reach.throughMedia)};
  Applies photons = photonsApply(traits, reach);
  if (!photons.yes || reach.causticBySmooth >= kCausticShare) return photons;
  const double beyond = reach.beyondCameraPaths - reach.throughMedia;
  if (beyond >= kUnreachableShare)
    return {true,
            fmt::format("{:.2g} % of the light in view comes from lights without size over smooth surfaces: no camera "
                        "path finds it",
                        100 * beyond),
            true};
  return {false,
          fmt::format("caustics of smooth surfaces are only {:.2g} % of the light in view: photons beside camera "
                      "paths cost less",
                      100 * reach.causticBySmooth),
          true};
}

}  // namespace braid
