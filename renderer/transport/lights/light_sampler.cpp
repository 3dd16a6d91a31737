// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/lights/light_sampler.h"

#include <algorithm>
#include <array>

#include "renderer/transport/bsdf/warp.h"

namespace braid {

namespace {

enum Kind : size_t { kFinite, kDirectional, kEnvironment };

LightBounds boundsOf(const Scene& scene, const EmissiveTriangle& e) {
  const Scene::Sweep sweep = scene.sweepOf(e);
  LightBounds b;
  b.bounds = sweep.bounds;
  b.axis = e.normal;
  // Between two steps the normal of one that turns may leave the cone of both.
  b.cosNormals = sweep.turns ? -1.0f : 1.0f;
  b.cosEmission = 0;
  b.power = e.power();
  b.twoSided = e.twoSided;
  return b;
}

float punctualPower(const PunctualLight& light) {
  const float intensity = average(light.intensity);
  return light.kind == PunctualKind::Point ? 4 * kPi * intensity
                                           : 2 * kPi * (1 - std::cos(light.outerConeAngle)) * intensity;
}

LightBounds boundsOf(const PunctualLight& light) {
  LightBounds b;
  b.bounds.extend(light.position);
  bool turns = light.kind == PunctualKind::Point;
  for (const LightPlace& step : light.steps) {
    b.bounds.extend(step.position);
    turns = turns || !(glm::dot(step.direction, light.direction) > 1 - 1e-6f);
  }
  b.range = light.range;
  b.axis = light.direction;
  // A point light has normals everywhere; a spot only within its cone. Power as if the cone were a full sphere:
  // importance is per direction.
  b.power = 4 * kPi * average(light.intensity);
  b.cosNormals = turns ? -1.0f : std::cos(light.outerConeAngle);
  b.cosEmission = light.kind == PunctualKind::Point ? 0.0f : std::cos(0.01f);
  return b;
}

std::vector<float> cumulativeOf(std::vector<double> weight) {
  std::vector<float> cumulative(weight.size() + 1, 0.0f);
  double total = 0;
  for (double w : weight) total += w;
  // TRAP: a share below the resolution of a float would be 0 and a dim point light beside a very bright one never
  // chosen.
  for (double& w : weight)
    if (w > 0) w = std::max(w, total * 0x1p-20);
  total = 0;
  for (double w : weight) total += w;
  double sum = 0;
  for (size_t i = 0; i < weight.size(); ++i) {
    sum += weight[i];
    cumulative[i + 1] = static_cast<float>(total > 0 ? sum / total : 0);
  }
  if (total > 0) cumulative.back() = 1;
  return cumulative;
}

// Picks an interval of a cumulative table; u becomes a fresh variate.
size_t pickInterval(const std::vector<float>& cumulative, float& u, float& probability) {
  const size_t count = cumulative.size() - 1;
  size_t i = 0;
  if (count <= 8) {
    for (size_t k = 1; k < count; ++k) i += u >= cumulative[k] ? 1u : 0u;
  } else {
    i = static_cast<size_t>(std::upper_bound(cumulative.begin() + 1, cumulative.end() - 1, u) - cumulative.begin() - 1);
  }
  probability = cumulative[i + 1] - cumulative[i];
  u = probability > 0 ? std::clamp((u - cumulative[i]) / probability, 0.0f, kOneMinusEpsilon) : u;
  return i;
}

}  // namespace

float spotFalloff(const PunctualLight& light, float cosAngle) {
  const float outer = std::cos(light.outerConeAngle), inner = std::cos(light.innerConeAngle);
  const float scale = 1 / std::max(0.001f, inner - outer);
  return sqr(std::clamp((cosAngle - outer) * scale, 0.0f, 1.0f));
}

bool hierarchyPays(size_t emissiveTriangles, size_t positionalLights) {
  const size_t finite = emissiveTriangles + positionalLights;
  return finite > 2 || (finite > 1 && positionalLights > 0);
}

LightSampler::LightSampler(const Scene& scene, LightStrategy strategy) : scene_(scene) {
  const std::vector<EmissiveTriangle>& emitters = scene.emitters();
  for (uint32_t i = 0; i < scene.lights().size(); ++i)
    (scene.lights()[i].kind == PunctualKind::Directional ? directional_ : positional_).push_back(i);
  finite_ = emitters.size() + positional_.size();
  hierarchy_ = strategy == LightStrategy::Hierarchy ||
               (strategy == LightStrategy::Automatic && hierarchyPays(emitters.size(), positional_.size()));

  double finitePower = 0;
  std::vector<double> powers;
  for (const EmissiveTriangle& e : emitters) powers.push_back(static_cast<double>(e.power()));
  for (uint32_t i : positional_) powers.push_back(static_cast<double>(punctualPower(scene.lights()[i])));
  for (double p : powers) finitePower += p;
  if (hierarchy_) {
    std::vector<LightBounds> bounds;
    bounds.reserve(finite_);
    for (const EmissiveTriangle& e : emitters) bounds.push_back(boundsOf(scene, e));
    for (uint32_t i : positional_) bounds.push_back(boundsOf(scene.lights()[i]));
    tree_.build(bounds);
  } else if (finite_ > 0) {
    cumulative_ = cumulativeOf(powers);
  }
  std::vector<double> irradiances;
  double directionalIrradiance = 0;
  for (uint32_t i : directional_) {
    irradiances.push_back(static_cast<double>(average(scene.lights()[i].intensity)));
    directionalIrradiance += irradiances.back();
  }
  directionalCumulative_ = cumulativeOf(irradiances);

  // Half evenly, so that no kind starves where the others are hidden.
  const double radius = static_cast<double>(scene.traits().radius);
  const double environmentIrradiance =
      scene.environment() ? static_cast<double>(kPi * average(scene.environment()->average())) : 0.0;
  const double share[3] = {finitePower / (4 * static_cast<double>(kPi) * radius * radius), directionalIrradiance,
                           environmentIrradiance};
  const double total = share[0] + share[1] + share[2];
  const int active = (share[0] > 0) + (share[1] > 0) + (share[2] > 0);
  if (active == 0 || !(total > 0) || !std::isfinite(total)) return;
  for (size_t i = 0; i < 3; ++i)
    if (share[i] > 0) kinds_[i] = active == 1 ? 1.0f : static_cast<float>(0.5 * share[i] / total + 0.5 / active);
}

bool LightSampler::sampleEmitter(const EmissiveTriangle& e, const Receiver& at, Vec2 u, LightSample& out) const {
  const Vec2 b = squareToTriangle(u);
  const float b1 = b.x, b2 = b.y;
  const Vec3 point = e.p0 + b1 * e.e1 + b2 * e.e2;
  const Vec3 d = point - at.position;
  const float distance2 = glm::dot(d, d);
  if (!(distance2 > 0)) return false;
  float cosLight = -glm::dot(d, e.normal);
  if (e.twoSided) cosLight = std::abs(cosLight);
  if (!(cosLight > 0)) return false;
  // The receiver's side first: half of all samples end here, before the square root.
  if (!at.twoSided && !(glm::dot(d, at.normal) > 0)) return false;
  out.distance = std::sqrt(distance2);
  const float inverse = 1 / out.distance;
  out.wi = d * inverse;
  cosLight *= inverse;
  out.radiance = e.textured ? scene_.coveredEmission(scene_.mesh(e.mesh), e.triangle, b1, b2) : e.meanRadiance;
  out.pdfW = distance2 / (cosLight * e.area);
  out.delta = false;
  return out.pdfW > 0 && std::isfinite(out.pdfW);
}

bool LightSampler::samplePunctual(const PunctualLight& light, const Receiver& at, LightSample& out) const {
  const LightPlace place = placeAt(light, at.time);
  const Vec3 d = place.position - at.position;
  const float distance2 = glm::dot(d, d);
  if (!(distance2 > 0)) return false;
  out.distance = std::sqrt(distance2);
  out.wi = d / out.distance;
  out.radiance = light.intensity / distance2 * rangeWindow(light, out.distance);
  if (light.kind == PunctualKind::Spot) out.radiance *= spotFalloff(light, -glm::dot(out.wi, place.direction));
  out.pdfW = 1;
  out.delta = true;
  return !isBlack(out.radiance) && isFinite(out.radiance);
}

bool LightSampler::sampleFinite(const Receiver& at, size_t light, float probability, Vec2 u, LightSample& out) const {
  if (!(probability > 0)) return false;
  out.light = static_cast<uint32_t>(light);
  const size_t emitters = scene_.emitters().size();
  EmissiveTriangle moved;
  const bool ok = light < emitters ? sampleEmitter(scene_.emitterAt(light, at.time, moved), at, u, out)
                                   : samplePunctual(scene_.lights()[positional_[light - emitters]], at, out);
  out.pdfW *= probability * kinds_[kFinite];
  return ok && out.pdfW > 0;
}

bool LightSampler::sampleInfinite(const Receiver& at, float uSelect, Vec2 u, LightSample& out) const {
  if (uSelect < kinds_[kFinite] + kinds_[kDirectional]) {
    float select = std::clamp((uSelect - kinds_[kFinite]) / kinds_[kDirectional], 0.0f, kOneMinusEpsilon),
          probability = 0;
    const size_t index = pickInterval(directionalCumulative_, select, probability);
    const PunctualLight& light = scene_.lights()[directional_[index]];
    out.light = firstDirectional() + static_cast<uint32_t>(index);
    out.wi = -placeAt(light, at.time).direction;
    out.distance = kInfinity;
    out.radiance = light.intensity;
    out.pdfW = probability * kinds_[kDirectional];
    out.delta = true;
    return out.pdfW > 0;
  }
  if (kinds_[kEnvironment] == 0) return false;
  out.pdfW =
      scene_.environment()->sample(at.twoSided ? Vec3(0) : at.normal, u, out.wi, out.radiance) * kinds_[kEnvironment];
  if (!(out.pdfW > 0) || !std::isfinite(out.pdfW)) return false;
  out.light = environmentLight();
  out.distance = kInfinity;
  out.delta = false;
  return true;
}

bool LightSampler::sample(const Receiver& at, float uSelect, Vec2 u, LightSample& out) const {
  if (!(uSelect < kinds_[kFinite])) return sampleInfinite(at, uSelect, u, out);
  float select = std::min(uSelect / kinds_[kFinite], kOneMinusEpsilon), probability = 0;
  if (!hierarchy_) {
    const size_t light = pickInterval(cumulative_, select, probability);
    return sampleFinite(at, light, probability, u, out);
  }
  LightQuery query = queryOf(at, select);
  tree_.sample(query);
  return sampleFinite(at, query.light, query.probability, u, out);
}

bool LightSampler::sample(const Receiver& at, const LightQuery& picked, Vec2 u, LightSample& out) const {
  return picked.u < kinds_[kFinite] ? sampleFinite(at, picked.light, picked.probability, u, out)
                                    : sampleInfinite(at, picked.u, u, out);
}

void LightSampler::pick(std::span<LightQuery> queries) const {
  for (; queries.size() > LightTree::kMostQueries; queries = queries.subspan(LightTree::kMostQueries))
    pick(queries.first(LightTree::kMostQueries));
  // Those that ask for a finite light: what is left of the variate is one of theirs.
  std::array<LightQuery, LightTree::kMostQueries> finite;
  size_t count = 0;
  for (const LightQuery& query : queries)
    if (query.u < kinds_[kFinite]) {
      finite[count] = query;
      finite[count++].u = std::min(query.u / kinds_[kFinite], kOneMinusEpsilon);
    }
  tree_.sample({finite.data(), count});
  count = 0;
  for (LightQuery& query : queries)
    if (query.u < kinds_[kFinite]) {
      query.light = finite[count].light;
      query.probability = finite[count++].probability;
    }
}

float LightSampler::finiteProbability(const Receiver& at, size_t light) const {
  if (hierarchy_) return tree_.empty() ? 0 : tree_.probability(queryOf(at, 0), static_cast<uint32_t>(light));
  return cumulative_[light + 1] - cumulative_[light];
}

float LightSampler::areaOf(size_t emitter, float time) const {
  EmissiveTriangle moved;
  return scene_.emitterAt(emitter, time, moved).area;
}

float LightSampler::pdfEmitter(const Receiver& at, size_t index, float distance, float cosLight) const {
  if (kinds_[kFinite] == 0) return 0;
  const float pdf = sqr(distance) / (cosLight * areaOf(index, at.time));
  const float choice = finiteProbability(at, index) * kinds_[kFinite];
  const float result = choice * pdf;
  return std::isfinite(result) ? result : 0.0f;
}

float LightSampler::pdfDirect(uint32_t light, const Receiver& at, const Vec3& toLight) const {
  if (light < finite_) {
    if (kinds_[kFinite] == 0) return 0;
    const float choice = finiteProbability(at, light) * kinds_[kFinite];
    return light < firstPositional() ? choice / areaOf(light, at.time) : choice;
  }
  if (light < environmentLight()) {
    const size_t i = light - finite_;
    return (directionalCumulative_[i + 1] - directionalCumulative_[i]) * kinds_[kDirectional];
  }
  return pdfEnvironment(at, toLight);
}

float LightSampler::pdfEnvironment(const Receiver& at, const Vec3& direction) const {
  if (kinds_[kEnvironment] == 0) return 0;
  const float pdf = scene_.environment()->pdfW(at.twoSided ? Vec3(0) : at.normal, direction) * kinds_[kEnvironment];
  return std::isfinite(pdf) ? pdf : 0.0f;
}

}  // namespace braid
