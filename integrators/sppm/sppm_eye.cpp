// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/sppm_eye.h"

#include <optional>

#include "integrators/camera_paths.h"
#include "renderer/core/error.h"
#include "renderer/transport/mis.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

WalkSettings eyeSettings(const Plan& plan, bool merges) {
  WalkSettings s;
  s.transport = Transport::Radiance;
  s.maxSegments = plan.settings.maxDepth;
  s.mis = false;
  s.deltaChains = merges;
  return s;
}

}  // namespace

PhotonEyeBatch::PhotonEyeBatch(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
                               const MediaStack& cameraMedia, const CausticMerging* caustics, float time)
    : context_(context),
      scene_(context.scene),
      plan_(plan),
      sampler_(sampler),
      cameraMedia_(cameraMedia),
      caustics_(caustics),
      time_(time),
      lightsCanBeHit_(!context.scene.emitters().empty() || context.scene.environment()),
      walks_(context, sampler, eyeSettings(plan, caustics)),
      likely_(context, plan, sampler),
      shadowRays_(context) {}

void PhotonEyeBatch::clear() {
  walks_.clear();
  count_ = 0;
}

void PhotonEyeBatch::start(int x, int y, uint64_t key) {
  BRAID_ASSERT(count_ < kBatch);
  const SampleBlock camera = sampler_.block(key, 0);
  const Camera::CameraRay ray = cameraRayThrough(plan_, camera, x, y, time_);
  path_[static_cast<size_t>(count_)] = Path();
  sample_[static_cast<size_t>(count_)] = PathSample();
  bias_[static_cast<size_t>(count_)] = Spectrum(0);
  start_[static_cast<size_t>(count_)] = {x, y, key, time_};
  ++count_;
  walks_.startCamera(key, ray, cameraMedia_, 1, 1, plan_.camera.orthographic());
}

PhotonEyeBatch::Step PhotonEyeBatch::shade(int index, SubpathState& state, SubpathVertex& vertex) {
  Path& path = path_[static_cast<size_t>(index)];
  path.arrive(state);
  // What a medium has scattered toward a broad lobe, photons bring.
  if (path.seekingLight && state.walked) return {};
  const MaterialSummary& material = context_.summaryOf(vertex.hit);
  if (material.unlit) {
    addUnlit(index, state, vertex);
    return {};
  }
  if (material.emissive) addEmission(index, state, vertex);
  if (path.seekingLight) return {.onward = Onward::Pass};
  const bool first = plan_.kept.features && !path.featuresDone &&
                     recordFeatures(scene_, vertex, plan_.settings.maxDepth, sample_[static_cast<size_t>(index)]);
  path.featuresDone = path.featuresDone || first;
  if (vertex.segments >= plan_.settings.maxDepth) return {.onward = Onward::Pass};
  if (!vertex.bsdf.hasNonDelta()) return {.onward = Onward::Scatter};

  const SampleBlock block = sampler_.block(state.key, state.block());
  const float share = vertex.bsdf.broadShare();
  std::optional<Bsdf> broad, narrow;
  if (share > 0 && share < 1) {
    broad.emplace(vertex.bsdf.restricted(LobeGroup::Broad));
    narrow.emplace(vertex.bsdf.restricted(LobeGroup::Narrow));
  }
  sampleLight(index, vertex,
              {share > 0 ? (broad ? &*broad : &vertex.bsdf) : nullptr,
               share < 1 ? (narrow ? &*narrow : &vertex.bsdf) : nullptr, share},
              block, first);
  if (caustics_ && share < 1) mergeCaustics(index, vertex, narrow ? *narrow : vertex.bsdf, 1 - share);
  const bool gathers = block.u[slot::kExtra] < share;
  if (broad) {
    path.choiceHere = gathers ? share : 1 - share;
    vertex.bsdf = gathers ? *broad : *narrow;
    state.throughput /= path.choiceHere;
    vertex.throughput /= path.choiceHere;
  }
  if (!gathers) return {.onward = Onward::Scatter};
  path.seekingLight = true;
  const bool seeks = lightsCanBeHit_ && !plan_.settings.photonDirect;
  return {.onward = seeks ? Onward::Scatter : Onward::End, .gather = true};
}

void PhotonEyeBatch::addGathered(int index, const SubpathVertex& vertex, const PhotonSum& sum, double lightPaths,
                                 float radius) {
  const GatheredLight light = gatheredLight(sum, lightPaths, radius);
  photonCount += sum.photons;
  sample_[static_cast<size_t>(index)].radiance += vertex.throughput * light.radiance;
  bias_[static_cast<size_t>(index)] += vertex.throughput * light.bias;
}

void PhotonEyeBatch::mergeCaustics(int index, const SubpathVertex& vertex, const Bsdf& narrow, float choice) {
  if (!narrow.hasNonDelta()) return;
  const float radius = caustics_->grid.scale().radiusAt(vertex.hit.position, vertex.travelled);
  const double density = caustics_->density(radius);
  path_[static_cast<size_t>(index)].mergedHere2 = sqr(density / static_cast<double>(choice));
  const PhotonSum sum =
      gatherCaustics(*caustics_, vertex, narrow, choice, radius, plan_.settings.maxDepth - vertex.segments);
  addGathered(index, vertex, sum, caustics_->lightPaths, radius);
}

// Weight of a light that was hit where next-event estimation could not find it; `direction` leads away from the light.
float PhotonEyeBatch::causticHitWeight(int index, const SubpathState& state, uint32_t light, const Vec3& direction,
                                       float cosLight) const {
  const double merged2 = path_[static_cast<size_t>(index)].merged2;
  if (state.deltaRun == 0 || !(merged2 > 0)) return 1;
  const float emit = caustics_->emission.pdfEmit(light, direction, cosLight, time_);
  if (!(emit > 0)) return 1;
  return static_cast<float>(1 / (1 + sqr(static_cast<double>(emit)) * state.chain * merged2));
}

// As in the path tracer: shown to the camera and to mirrors only.
void PhotonEyeBatch::addUnlit(int index, const SubpathState& state, const SubpathVertex& vertex) {
  PathSample& sample = sample_[static_cast<size_t>(index)];
  bool& done = path_[static_cast<size_t>(index)].featuresDone;
  const Spectrum color = unlitColor(scene_, vertex, plan_.kept.features && !done, sample);
  done = true;
  if (state.lightCouldNotBeSampled) sample.radiance += vertex.throughput * color;
}

void PhotonEyeBatch::addEmission(int index, const SubpathState& state, const SubpathVertex& vertex) {
  const Hit& hit = vertex.hit;
  const Spectrum radiance = emissionAt(scene_, hit);
  if (isBlack(radiance)) return;
  float weight = 1;
  if (const auto found = lightAt(scene_, hit)) {
    if (state.lightCouldNotBeSampled)
      weight = causticHitWeight(index, state, found->light, hit.wo, found->cosine);
    else
      weight =
          powerHeuristic(path_[static_cast<size_t>(index)].choice * state.lastPdfW,
                         context_.lights.pdfEmitter(state.lastReceiver(), found->light,
                                                    glm::length(hit.position - state.lastPosition), found->cosine));
  }
  sample_[static_cast<size_t>(index)].radiance += vertex.throughput * radiance * weight;
}

void PhotonEyeBatch::addEnvironment(int index, const SubpathState& state) {
  PathSample& sample = sample_[static_cast<size_t>(index)];
  Path& path = path_[static_cast<size_t>(index)];
  path.arrive(state);
  if (path.seekingLight && state.walked) return;
  const Spectrum radiance =
      radianceBeyond(scene_, plan_, state.direction, state.fromCamera(), !path.featuresDone, state.leastLobe, sample);
  if (isBlack(radiance)) return;
  float weight = 1;
  if (state.lightCouldNotBeSampled)
    weight = causticHitWeight(index, state, context_.lights.environmentLight(), -state.direction, 1);
  else
    weight = powerHeuristic(path.choice * state.lastPdfW,
                            context_.lights.pdfEnvironment(state.lastReceiver(), state.direction));
  sample.radiance += state.throughput * radiance * weight;
}

void PhotonEyeBatch::sampleLight(int index, const SubpathVertex& vertex, const Lobes& lobes, const SampleBlock& block,
                                 bool forFeatures) {
  const Hit& hit = vertex.hit;
  LightSample light;
  if (!context_.lights.sample(vertex.receiver(), block.u[slot::kLightSelect],
                              {block.u[slot::kLightU], block.u[slot::kLightV]}, light))
    return;
  const Vec3 wi = hit.frame.toLocal(light.wi);
  const bool reflects = glm::dot(light.wi, hit.ng) > 0;
  if (reflects != (wi.z > 0) || (!reflects && !vertex.twoSided)) return;
  // The two groups are estimated side by side; each has its own density of hitting the light.
  Spectrum value(0);
  const auto add = [&](const Bsdf* bsdf, float choice, bool counts) {
    if (!bsdf || !counts) return;
    const BsdfValue v = bsdf->evaluate(wi);
    value += v.f * (light.delta ? 1.0f : powerHeuristic(light.pdfW, choice * v.pdfW));
  };
  add(lobes.broad, lobes.broadShare, !plan_.settings.photonDirect);
  add(lobes.narrow, 1 - lobes.broadShare, true);
  // Where photons bring the direct light, the ray still tells what is visible.
  if (isBlack(value) && !(forFeatures && plan_.settings.photonDirect)) return;
  Spectrum contribution = vertex.throughput * value * light.radiance * (1 / light.pdfW);
  MediaStack media = vertex.media;
  if (!reflects && context_.summaryOf(hit).volume) media.cross(hit.mesh->material, hit.front);
  contribution *= mediaTransmittance(scene_, media, light.distance);

  const uint32_t salt = sampler_.salt(vertex.key, 0x10000u + static_cast<uint32_t>(vertex.segments)) & ~kCameraRay;
  shadowRays_.set(shadowCount_, shadowRay(hit, light.wi, light.distance, salt), mediumIndex(scene_, media));
  shadow_[static_cast<size_t>(shadowCount_)] = {index, contribution, forFeatures};
  if (++shadowCount_ == kBatch) traceShadows();
}

void PhotonEyeBatch::traceShadows() {
  shadowRays_.trace(shadowCount_);
  shadowRayCount += static_cast<uint64_t>(shadowCount_);
  for (int k = 0; k < shadowCount_; ++k) {
    if (shadowRays_.hidden(k)) continue;
    Shadow& shadow = shadow_[static_cast<size_t>(k)];
    shadowRays_.attenuate(k, shadow.contribution);
    PathSample& sample = sample_[static_cast<size_t>(shadow.index)];
    sample.radiance += shadow.contribution;
    if (shadow.forFeatures) sample.features.visibility = 1;
  }
  shadowCount_ = 0;
}

}  // namespace braid
