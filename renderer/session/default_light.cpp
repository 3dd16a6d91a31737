// SPDX-License-Identifier: Apache-2.0
#include "renderer/session/default_light.h"

#include <algorithm>

#include <fmt/format.h>

#include "renderer/scene/data/scene_defaults.h"
#include "renderer/transport/light_reach.h"
#include "renderer/transport/lit_share.h"

namespace braid {

namespace {

constexpr double kLeastLit = 0.01;

// What counts as full light.
double referenceRadiance(const Scene& scene, double dome) {
  if (!scene.lights().empty()) return dome;
  double brightest = 0;
  for (const EmissiveTriangle& e : scene.emitters())
    brightest = std::max(brightest, static_cast<double>(average(e.meanRadiance)));
  return brightest > 0 ? std::min(dome, brightest) : dome;
}

// The share of what the camera sees that the scene's lights light; none where nothing seen needs light.
std::optional<double> litShare(const Scene& scene, const Camera& camera, int width, int height, double dome) {
  const TransportContext context(scene);
  const double reference = referenceRadiance(scene, dome);
  const LitShare direct = measureLitShare(context, camera, width, height, reference);
  if (!(direct.seen > 0)) return {};
  if (direct.share >= kLeastLit) return direct.share;
  // What camera paths do not find at once: light from other surfaces and through glass.
  const double scattered = measureLightReach(context, camera, width, height).scatteredRadiance;
  return std::min(1.0, direct.share + scattered / reference);
}

}  // namespace

std::optional<std::string> lightIfDark(Scene& scene, const CameraData& data, int width, int height, float scale) {
  const double dome = static_cast<double>(kDefaultDome * scale);
  const bool hasDome = scene.data().defaultLight;
  if (!(dome > 0) || (scene.environment() && !hasDome)) return {};
  const Camera camera(data, width, height);
  std::string text;
  if (!hasDome) {
    if (!scene.traits().has(kTraitEmissiveTriangles | kTraitPointLights | kTraitDirectionalLights)) return {};
    const std::optional<double> own = litShare(scene, camera, width, height, dome);
    if (!own || *own >= kLeastLit) return {};
    text = fmt::format(
        "the lights of the file light {:.2g} % of what the camera sees; a grey dome of radiance {:.2g} is "
        "added (--no-default-light: none)",
        100 * *own, dome);
    scene.addDefaultLight(Spectrum(kDefaultDome * scale), text);
  }
  const std::optional<double> lit = litShare(scene, camera, width, height, dome);
  if (!lit || *lit >= kLeastLit) return text.empty() ? std::nullopt : std::optional(text);
  text = fmt::format(
      "{}{}the grey dome does not reach what the camera sees: the picture stays dark (--camera, --look-at: "
      "look from elsewhere)",
      text, text.empty() ? "" : "; ");
  return text;
}

}  // namespace braid
