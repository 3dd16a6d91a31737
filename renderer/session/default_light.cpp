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
// Of what shines by itself: labels and lamps on a thing do not show the thing.
constexpr double kLeastShining = 0.25;

// What counts as full light.
double referenceRadiance(const Scene& scene, double dome) {
  if (!scene.lights().empty()) return dome;
  double brightest = 0;
  for (const EmissiveTriangle& e : scene.emitters())
    brightest = std::max(brightest, static_cast<double>(average(e.meanRadiance)));
  return brightest > 0 ? std::min(dome, brightest) : dome;
}

// What the scene's lights do for what the camera sees.
struct Lit {
  double received = 0;  // the share that their light meets
  bool enough = false;
  bool showsUnlit = false;  // surfaces that need no light are a good part of the picture
};

// None where nothing seen needs light.
std::optional<Lit> measureLit(const Scene& scene, const Camera& camera, int width, int height, double dome) {
  const TransportContext context(scene);
  const double reference = referenceRadiance(scene, dome);
  const LitShare direct = measureLitShare(context, camera, width, height, reference);
  if (!(direct.seen > 0)) return {};
  const bool showsUnlit = direct.unlit >= kLeastShining * (direct.unlit + direct.seen);
  if (direct.received >= kLeastLit || direct.share >= kLeastShining) return Lit{direct.received, true, showsUnlit};
  // What camera paths do not find at once: light from other surfaces and through glass.
  const double scattered = measureLightReach(context, camera, width, height).scatteredRadiance;
  const double received = std::min(1.0, direct.received + scattered / reference);
  return Lit{received, received >= kLeastLit, showsUnlit};
}

bool hasLights(const Scene& scene) {
  return scene.traits().has(kTraitEmissiveTriangles | kTraitPointLights | kTraitDirectionalLights);
}

// Of a scene that no light may be added to.
std::optional<std::string> sayIfDark(const Scene& scene, const Camera& camera, int width, int height, double dome) {
  const bool hasEnvironment = scene.environment().has_value();
  if (hasEnvironment && average(scene.environment()->average()) > 0) return {};
  const std::optional<Lit> lit = measureLit(scene, camera, width, height, dome);
  if (!lit || lit->enough || lit->showsUnlit) return {};
  return fmt::format("{}{}: the picture stays dark ({})", hasEnvironment ? "the environment is black, and " : "",
                     hasLights(scene) ? fmt::format("the lights of the file light {:.2g} % of what the camera sees",
                                                    100 * lit->received)
                                      : "the file has no light",
                     hasEnvironment ? "without --env a studio is added" : "--default-light studio adds one");
}

}  // namespace

std::optional<std::string> lightIfDark(Scene& scene, const CameraData& data, int width, int height, float scale,
                                       DefaultLight kind) {
  const double dome = static_cast<double>(kDefaultDome * scale);
  if (!(dome > 0)) return {};
  const bool hasDome = scene.data().defaultLight;
  const Camera camera(data, width, height);
  if (kind == DefaultLight::None || (scene.environment() && !hasDome))
    return sayIfDark(scene, camera, width, height, dome);
  std::string text;
  if (!hasDome) {
    if (!hasLights(scene)) return {};
    const std::optional<Lit> own = measureLit(scene, camera, width, height, dome);
    if (!own || own->enough) return {};
    text = fmt::format("the lights of the file light {:.2g} % of what the camera sees; {}", 100 * own->received,
                       describeDefaultLight(kind));
    scene.addDefaultLight(kind, scale, text);
  }
  const std::optional<Lit> lit = measureLit(scene, camera, width, height, dome);
  if (!lit || lit->enough || lit->showsUnlit) return text.empty() ? std::nullopt : std::optional(text);
  text = fmt::format(
      "{}{}this light does not reach what the camera sees: the picture stays dark (--camera, --look-at: "
      "look from elsewhere)",
      text, text.empty() ? "" : "; ");
  return text;
}

}  // namespace braid
