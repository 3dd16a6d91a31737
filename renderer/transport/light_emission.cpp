// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/light_emission.h"

#include <algorithm>

#include "renderer/core/parallel.h"
#include "renderer/transport/hit.h"
#include "renderer/transport/bsdf/warp.h"

namespace braid {

namespace {

double lightPower(const Scene& scene, const LightSampler& lights, uint32_t light) {
  const double disc = static_cast<double>(kPi) * sqr(static_cast<double>(scene.traits().radius));
  if (light < lights.firstPositional()) return static_cast<double>(scene.emitters()[light].power());
  if (light < lights.firstDirectional()) {
    const PunctualLight& l = lights.positional(light);
    const double sphere = l.kind == PunctualKind::Point ? 2.0 : 1 - std::cos(static_cast<double>(l.outerConeAngle));
    return 2 * static_cast<double>(kPi) * sphere * static_cast<double>(average(l.intensity));
  }
  if (light < lights.environmentLight())
    return disc * static_cast<double>(average(lights.directional(light).intensity));
  return disc * 4 * static_cast<double>(kPi) * static_cast<double>(average(scene.environment()->average()));
}

// 1 - cos of a spot's half angle, kept positive.
float coneOpening(const PunctualLight& light) { return std::max(1 - std::cos(light.outerConeAngle), 1e-6f); }

// Density of spot directions, uniform in the cone.
float conePdf(const PunctualLight& light) {
  return light.kind == PunctualKind::Point ? kInvFourPi : conePdfW(coneOpening(light));
}

}  // namespace

LightEmission::LightEmission(const Scene& scene, const LightSampler& lights, const std::vector<float>& usefulness)
    : scene_(scene), lights_(lights) {
  std::vector<double> sum(size_t(lights.size()) + 1, 0.0);
  for (uint32_t i = 0; i < lights.size(); ++i) {
    const double power = lightPower(scene, lights, i);
    if (!(power > 0) || !std::isfinite(power)) {
      sum[i + 1] = sum[i];
      continue;
    }
    power_ += power;
    sum[i + 1] = sum[i] + power * (usefulness.empty() ? 1.0 : static_cast<double>(usefulness[i]));
  }
  const double total = sum.back();
  if (!(total > 0) || !std::isfinite(total)) return;
  for (double& s : sum) s /= total;
  cumulative_ = std::move(sum);
  if (scene.traits().has(kTraitVolume) && !scene.moves()) findMedia();
}

void LightEmission::findMedia() {
  std::vector<MediaStack> around(lights_.firstDirectional());
  parallelChunks(around.size(), 256, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const auto light = static_cast<uint32_t>(i);
      if (light < lights_.firstPositional()) {
        const EmissiveTriangle& e = scene_.emitters()[light];
        const Vec3 centre = e.p0 + (e.e1 + e.e2) * (1.0f / 3);
        const float error = 1e-6f * maxComponent(glm::max(magnitudes(e.p0), magnitudes(centre)));
        around[i] = mediaAround(scene_, offsetOrigin(centre, error, e.normal, e.normal), e.normal, 0);
      } else {
        around[i] = mediaAround(scene_, lights_.positional(light).position, Vec3(0.36f, 0.48f, 0.8f), 0);
      }
    }
  });
  for (uint32_t i = 0; i < around.size(); ++i)
    if (!around[i].empty()) media_.emplace_back(i, around[i]);
}

// Where things move, each path looks for itself.
MediaStack LightEmission::mediaAt(const LightStart& start) const {
  if (scene_.moves()) {
    if (!start.finite || !scene_.traits().has(kTraitVolume)) return {};
    const Vec3 origin = offsetOrigin(start.position, start.positionError, start.normal, start.direction);
    return mediaAround(scene_, origin, start.direction, start.time);
  }
  const auto found = std::lower_bound(media_.begin(), media_.end(), start.light,
                                      [](const auto& entry, uint32_t l) { return entry.first < l; });
  return found != media_.end() && found->first == start.light ? found->second : MediaStack();
}

bool LightEmission::sample(double uSelect, Vec2 uPosition, Vec2 uDirection, float time, LightStart& out) const {
  if (cumulative_.empty()) return false;
  out.time = time;
  const auto found = std::upper_bound(cumulative_.begin() + 1, cumulative_.end() - 1, uSelect);
  out.light = static_cast<uint32_t>(found - cumulative_.begin() - 1);
  // Lights of zero power at the end of the table share its last bound.
  while (out.light > 0 && !(probability(out.light) > 0)) --out.light;
  const bool ok = out.light < lights_.firstPositional()    ? startOnTriangle(out.light, uPosition, uDirection, out)
                  : out.light < lights_.firstDirectional() ? startAtPoint(out.light, uDirection, out)
                                                           : startAtInfinity(out.light, uPosition, uDirection, out);
  return ok && out.pdfEmit > 0 && std::isfinite(out.pdfEmit) && isFinite(out.throughput) && !isBlack(out.throughput);
}

bool LightEmission::startOnTriangle(uint32_t light, Vec2 uPosition, Vec2 uDirection, LightStart& out) const {
  EmissiveTriangle moved;
  const EmissiveTriangle& e = scene_.emitterAt(light, out.time, moved);
  const Vec2 b = squareToTriangle(uPosition);
  float side = 1;
  if (e.twoSided) {
    side = uDirection.x < 0.5f ? 1.0f : -1.0f;
    uDirection.x = std::min(uDirection.x < 0.5f ? 2 * uDirection.x : 2 * uDirection.x - 1, kOneMinusEpsilon);
  }
  const Vec3 local = squareToCosineHemisphere(uDirection);
  out.normal = e.normal * side;
  out.position = e.p0 + b.x * e.e1 + b.y * e.e2;
  out.positionError = 1e-6f * maxComponent(glm::max(magnitudes(e.p0), magnitudes(out.position)));
  out.direction = renormalize(Frame(out.normal).toWorld(local));
  out.cosLight = local.z;
  out.finite = true;
  out.delta = false;
  out.pdfEmit = pdfEmit(light, out.direction, out.cosLight, out.time);
  const Spectrum radiance =
      e.textured ? scene_.coveredEmission(scene_.mesh(e.mesh), e.triangle, b.x, b.y) : e.meanRadiance;
  out.throughput = radiance * (out.cosLight / out.pdfEmit);
  return true;
}

bool LightEmission::startAtPoint(uint32_t light, Vec2 uDirection, LightStart& out) const {
  const PunctualLight& l = lights_.positional(light);
  const LightPlace place = placeAt(l, out.time);
  out.position = place.position;
  out.positionError = 0;
  Spectrum intensity = l.intensity;
  if (l.kind == PunctualKind::Point) {
    out.direction = squareToUniformSphere(uDirection);
  } else {
    out.direction = renormalize(Frame(place.direction).toWorld(squareToCone(uDirection, coneOpening(l))));
    intensity *= spotFalloff(l, glm::dot(out.direction, place.direction));
  }
  out.normal = out.direction;
  out.cosLight = 1;
  out.finite = out.delta = true;
  out.pdfEmit = pdfEmit(light, out.direction, 1, out.time);
  out.throughput = intensity / out.pdfEmit;
  return true;
}

bool LightEmission::startAtInfinity(uint32_t light, Vec2 uPosition, Vec2 uDirection, LightStart& out) const {
  Spectrum radiance;
  if (light < lights_.environmentLight()) {
    const PunctualLight& l = lights_.directional(light);
    out.direction = placeAt(l, out.time).direction;
    out.delta = true;
    radiance = l.intensity;
  } else {
    Vec3 toLight;
    if (!(scene_.environment()->sample(Vec3(0), uDirection, toLight, radiance) > 0)) return false;
    out.direction = -toLight;
    out.delta = false;
  }
  const SceneTraits& t = scene_.traits();
  const Vec2 disc = squareToDisc(uPosition);
  const Frame frame(out.direction);
  out.position = t.centre + t.radius * (disc.x * frame.s + disc.y * frame.t - out.direction);
  out.positionError = 0;
  out.normal = out.direction;
  out.cosLight = 1;
  out.finite = false;
  out.pdfEmit = pdfEmit(light, out.direction, 1, out.time);
  out.throughput = radiance / out.pdfEmit;
  return true;
}

float LightEmission::pdfEmit(uint32_t light, const Vec3& direction, float cosLight, float time) const {
  if (cumulative_.empty()) return 0;
  const auto choice = static_cast<float>(probability(light));
  if (light < lights_.firstPositional()) {
    EmissiveTriangle moved;
    const EmissiveTriangle& e = scene_.emitterAt(light, time, moved);
    return choice * cosLight * kInvPi * (e.twoSided ? 0.5f : 1.0f) / e.area;
  }
  if (light < lights_.firstDirectional()) return choice * conePdf(lights_.positional(light));
  const float disc = kInvPi / sqr(scene_.traits().radius);
  return light < lights_.environmentLight() ? choice * disc
                                            : choice * disc * scene_.environment()->pdfW(Vec3(0), -direction);
}

}  // namespace braid
