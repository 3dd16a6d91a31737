// SPDX-License-Identifier: Apache-2.0
#include "integrators/path_kernel.h"

#include <algorithm>
#include <memory>

#include "integrators/camera_paths.h"
#include "renderer/core/error.h"
#include "renderer/session/path_time.h"
#include "renderer/transport/dispersion.h"
#include "renderer/transport/mis.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

constexpr int kMaxNullCrossings = 256;
constexpr float kLeastGuidedScale = 1e-4f;
// Later vertices carry too little for a guide to pay.
constexpr int kGuidedSegments = 3;

}  // namespace

void PathKernel::add(const Spectrum& radiance, bool direct, PathSample& sample) const {
  sample.radiance += radiance;
  if (direct) sample.direct += radiance;
}

void PathKernel::addEnvironment(const PathState& path, PathSample& sample) const {
  const Spectrum radiance =
      radianceBeyond(scene_, plan_, path.direction, path.fromCamera(), !path.featuresDone, path.leastLobe, sample);
  if (isBlack(radiance)) return;
  float weight = 1;
  if (!path.lightCouldNotBeSampled)
    weight = powerHeuristic(
        path.lastPdfW, path.lastLightSamples * context_.lights.pdfEnvironment(path.lastReceiver(), path.direction));
  add(path.throughput * radiance * weight, path.bounces <= 1, sample);
}

void PathKernel::addEmission(const PathState& path, const Hit& hit, PathSample& sample) const {
  const Spectrum radiance = emissionAt(scene_, hit);
  if (isBlack(radiance)) return;
  float weight = 1;
  const auto found = path.lightCouldNotBeSampled ? std::nullopt : lightAt(scene_, hit);
  if (found)
    weight = powerHeuristic(
        path.lastPdfW, path.lastLightSamples * context_.lights.pdfEmitter(path.lastReceiver(), found->light,
                                                                          glm::length(hit.position - path.lastPosition),
                                                                          found->cosine));
  add(path.throughput * radiance * weight, path.bounces <= 1, sample);
}

// A solid's surface inside a solid that rules there scatters nothing: keeps the books of what the path is inside of and
// goes on straight.
bool PathKernel::crossNullInterface(PathState& path, const Hit& hit) const {
  if (!isNullInterface(scene_, path.media, hit)) return false;
  path.media.cross(hit.mesh->material, hit.front);
  path.origin = offsetOrigin(hit, path.direction);
  path.featureDistance += hit.distance;
  path.lightCouldNotBeSampled = true;  // a shadow ray stops at the interface
  ++path.nullCrossings;
  return true;
}

// Straight on through a pane: MIS weights, the part of the light and the length of the path stay those of the last
// vertex. False: nothing gets through.
bool PathKernel::passPane(PathState& path, const Hit& hit, const Spectrum& weight) const {
  path.throughput *= weight;
  if (isBlack(path.throughput)) return false;
  path.origin = offsetOrigin(hit, path.direction);
  return ++path.panes < kMostPanes;
}

// No light is sampled within a medium, and what comes after an event is not direct light.
Flight PathKernel::finishFlight(PathState& path, const Hit* hit) const {
  const Flight flight = walk_.finish(path, hit);
  if (flight != Flight::Surface) path.lightCouldNotBeSampled = true;
  if (flight != Flight::Scattered) return flight;
  path.featureDistance += path.walk.flight;
  path.bounces = std::max(path.bounces + 1, 2);
  if (observer_) observer_->onScattering(path);
  return flight;
}

// What an unlit surface shows, it shows to the camera and to mirrors only: it lights nothing (KHR_materials_unlit).
void PathKernel::addUnlit(PathState& path, const Hit& hit, PathSample& sample) const {
  const Spectrum color = baseColorAt(scene_, hit);
  if (path.lightCouldNotBeSampled) add(path.throughput * color, path.bounces <= 1, sample);
  if (!wantFeatures_ || path.featuresDone) return;
  path.featuresDone = true;
  unlitFeatures(color, hit, path.featureDistance + hit.distance, sample.features);
  sample.leastLobe = path.leastLobe;
}

void PathKernel::recordFeatures(PathState& path, const Hit& hit, const Bsdf& bsdf, PathSample& sample) const {
  path.featureDistance += hit.distance;
  const bool goesOn = path.segments < plan_.settings.maxDepth || bsdf.passesStraight();
  if (!bsdf.hasNonDelta() && goesOn && !hit.material->scatters()) return;
  path.featuresDone = true;
  surfaceFeatures(scene_, hit, bsdf, path.featureDistance, sample.features);
  sample.leastLobe = path.leastLobe;
}

// Continues the path in a direction sampled from the BSDF and the guide; false when it ends here.
bool PathKernel::scatter(PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided,
                         const SampleBlock& block) const {
  GuidedSample sample;
  if (!bsdf.sample(block, sample)) return false;
  if (sample.delta && !path.featuresDone) path.leastLobe = std::min(path.leastLobe, sample.pdfW);
  if (!(sample.straight ? passPane(path, hit, sample.weight) : turn(path, hit, bsdf.bsdf(), twoSided, sample)))
    return false;
  if (!sample.delta) {
    if (recorder_) recorder_->leave(static_cast<int>(&path - path_.data()), hit, bsdf, sample);
    // Roulette takes the path for one that the BSDF has sampled: where the guide sends many, each carries little.
    if (bsdf.guided()) path.rouletteScale *= std::max(sample.bsdfPdfW / sample.pdfW, kLeastGuidedScale);
  }
  const float survival = roulette_.survival(path.segments, maxComponent(path.throughput) / path.rouletteScale);
  if (survival < 1) {
    if (!(block.u[slot::kRoulette] < survival)) return false;
    path.throughput /= survival;
  }
  if (!sample.straight) ++path.segments;
  return true;
}

bool PathKernel::turn(PathState& path, const Hit& hit, const Bsdf& bsdf, bool twoSided,
                      const BsdfSample& sample) const {
  const Vec3 direction = renormalize(hit.frame.toWorld(sample.wi));
  const bool reflects = glm::dot(direction, hit.ng) > 0;
  if (reflects == sample.transmitted) return false;
  path.throughput *= sample.weight;
  if (isBlack(path.throughput)) return false;

  if (sample.transmitted && hit.material->hasVolume())
    path.rouletteScale *= sqr(crossInterface(scene_, path.media, hit));
  path.origin = offsetOrigin(hit, direction);
  path.direction = direction;
  path.lastPosition = hit.position;
  path.lastNormal = receiverAt(hit, twoSided).normal;
  path.lastTwoSided = twoSided;
  path.lastPdfW = sample.pdfW * static_cast<float>(path.directions);
  path.lightCouldNotBeSampled = sample.delta;
  if (path.bounces > 0 || bsdf.hasNonDelta()) ++path.bounces;
  return true;
}

float PathKernel::timeOf(int x, int y, uint64_t key) const {
  return scene_.moves() ? pixelTime(scene_, plan_, sampler_.block(key, 0), x, y) : 0;
}

void PathKernel::startAt(float time, int x, int y, uint64_t key) {
  BRAID_ASSERT(count_ < kBatch);
  const SampleBlock camera = sampler_.block(key, 0);
  const Camera::CameraRay ray = cameraRayThrough(plan_, camera, x, y, time);
  const auto i = static_cast<size_t>(count_++);
  start_[i] = {x, y, key, time};
  // In place: assigned, they would take the way over the stack.
  std::construct_at(&sample_[i]);
  PathState& path = *std::construct_at(&path_[i]);
  path.key = path.pointsKey = key;
  path.points = &sampler_;
  path.sample = static_cast<int>(i);
  isSplit_[i] = false;
  path.origin = ray.origin;
  path.direction = ray.direction;
  path.time = time;
  path.media = scene_.moves() ? mediaOfCamera(scene_, plan_.camera, time) : cameraMedia_;
  path.channel = channelOf(scene_, sampler_, key);
  path.segments = 1;
}

void PathKernel::run() {
  activeCount_ = count_;
  free_.clear();
  for (int i = static_cast<int>(path_.size()); i-- > count_;) free_.push_back(i);
  for (int i = 0; i < count_; ++i) {
    active_[static_cast<size_t>(i)] = i;
    queueRay(i, path_[static_cast<size_t>(i)]);
  }
  // A small scene's vertices are in the cache anyway.
  const bool prefetch = scene_.traits().triangles > 16384;
  while (activeCount_ > 0) {
    traceActive();
    if (prefetch) prefetchVertices(scene_, {query_.data(), static_cast<size_t>(activeCount_)});
    shadeActive();
    traceShadows();
  }
  addBranches();
  for (size_t i = 0; i < static_cast<size_t>(count_); ++i) likely_.add(start_[i], sample_[i]);
  rayCount += likely_.run();
}

void PathKernel::queueRay(int slot, PathState& path) {
  const float reach = walk_.any() ? walk_.begin(path) : kInfinity;
  if (filtered_) {
    const uint32_t salt = sampler_.salt(path.key, path.block() + static_cast<uint32_t>(path.nullCrossings) +
                                                      (static_cast<uint32_t>(path.walk.rays) << 12));
    path.salt = (salt & ~kCameraRay) | (path.fromCamera() ? kCameraRay : 0);
  }
  rays_.set(slot, {path.origin, path.direction, reach, path.salt, path.time});
  if (observer_) observer_->onRay(path);
}

void PathKernel::traceActive() {
  if (record_)
    for (int a = 0; a < activeCount_; ++a) record_->push_back({rays_.get(a), false});
  scene_.accel().intersect(rays_, activeCount_, query_.data());
  rayCount += static_cast<uint64_t>(activeCount_);
}

// What needs nothing but the ray and the path's key comes first, for all paths: a short loop, of which the processor
// works on several rounds at once.
void PathKernel::prepareShading() {
  for (int a = 0; a < activeCount_; ++a) {
    const auto i = static_cast<size_t>(a);
    if (!(query_[i].t < kInfinity)) continue;
    const PathState& path = path_[static_cast<size_t>(active_[i])];
    makeHit(scene_, query_[i], path.direction, hit_[i]);
    block_[i] = path.points->block(path.pointsKey, path.block());
  }
  if (context_.lights.usesHierarchy()) pickLights();
}

void PathKernel::shadeActive() {
  prepareShading();
  int alive = 0;
  const auto goOn = [&](int p) {
    active_[static_cast<size_t>(alive)] = p;
    queueRay(alive++, path_[static_cast<size_t>(p)]);
  };
  shadowCount_ = 0;
  for (int a = 0; a < activeCount_; ++a) {
    const int p = active_[static_cast<size_t>(a)];
    const auto i = static_cast<size_t>(p), ray = static_cast<size_t>(a);
    PathSample& sample = sample_[static_cast<size_t>(path_[i].sample)];
    if (recorder_) recorder_->arrive(p, sample.radiance);
    const bool met = query_[ray].t < kInfinity;
    if (walk_.any() && path_[i].walk.medium) {
      const Flight flight = finishFlight(path_[i], met ? &hit_[ray] : nullptr);
      if (flight == Flight::Scattered) goOn(p);
      if (flight == Flight::Absorbed) free_.push_back(p);
      if (flight == Flight::Scattered || flight == Flight::Absorbed) continue;
    }
    if (!met) {
      ++missCount;
      if (observer_) observer_->onMiss();
      addEnvironment(path_[i], sample);
      free_.push_back(p);
    } else if (shade(p, ray)) {
      goOn(p);
    } else {
      free_.push_back(p);
    }
  }
  for (; alive < kBatch && !waiting_.empty(); waiting_.pop_back()) goOn(waiting_.back());
  activeCount_ = alive;
}

void PathKernel::traceShadows() {
  if (record_)
    for (int k = 0; k < shadowCount_; ++k) record_->push_back({shadowRays_.get(k), true});
  shadowRays_.trace(shadowCount_);
  for (int k = 0; k < shadowCount_; ++k) {
    ShadowRay& shadow = shadow_[static_cast<size_t>(k)];
    const bool hidden = shadowRays_.hidden(k);
    if (!hidden) shadowRays_.attenuate(k, shadow.contribution);
    if (observer_) observer_->onLight(shadow, !hidden);
    if (hidden) continue;
    PathSample& sample = sample_[static_cast<size_t>(shadowPath_[static_cast<size_t>(k)])];
    add(shadow.contribution, shadow.direct, sample);
    if (shadow.forFeatures) sample.features.visibility = 1;
  }
  shadowRayCount += static_cast<uint64_t>(shadowCount_);
}

bool PathKernel::shade(int p, size_t ray) {
  const Hit& hit = hit_[ray];
  PathState& path = path_[static_cast<size_t>(p)];
  PathSample& sample = sample_[static_cast<size_t>(path.sample)];
  if (observer_) observer_->onHit(hit);
  if (!path.walk.medium) path.throughput *= mediaTransmittance(scene_, path.media, hit.distance);
  const MaterialSummary& material = context_.summaryOf(hit);
  if (material.special()) {
    if (material.volume && crossNullInterface(path, hit)) return path.nullCrossings < kMaxNullCrossings;
    if (material.unlit) {
      addUnlit(path, hit, sample);
      return false;
    }
    if (material.emissive) addEmission(path, hit, sample);
    sample.onGround = sample.onGround || (material.ground && path.fromCamera());
  }
  if (!coloursPart(context_, path.media, hit, path.channel)) return shadeSurface(p, ray);
  if (!recorder_) return shadeColours(p, ray);
  followOne(path.channel.index, 3, path.channel, path.throughput);
  return shadeSurface(p, ray);
}

// What scatters at the hit of a ray: features, light samples, and the direction in which the path goes on.
bool PathKernel::shadeSurface(int p, size_t ray) {
  const Hit& hit = hit_[ray];
  PathState& path = path_[static_cast<size_t>(p)];
  PathSample& sample = sample_[static_cast<size_t>(path.sample)];
  const MaterialSummary& material = context_.summaryOf(hit);
  const uint32_t lobes = material.lobes;
  const Vec3 wo = hit.frame.toLocal(hit.wo);
  const Bsdf bsdf = lobes == kLobeDiffuse ? Bsdf(baseColorAt(scene_, hit), wo)
                                          : Bsdf(surfaceAt(scene_, hit, lobes, path.media, path.channel), wo);
  const bool firstNonSpecular = wantFeatures_ && !path.featuresDone;
  if (firstNonSpecular) recordFeatures(path, hit, bsdf, sample);
  if (path.segments >= plan_.settings.maxDepth) return passPane(path, hit, bsdf.straightTransmittance());

  const bool twoSided = material.transmits();
  const bool asks = aids_.guide && path.segments <= kGuidedSegments && bsdf.hasNonDelta() && !path.walk.medium;
  const GuidedBsdf guided = asks ? GuidedBsdf(bsdf, *aids_.guide, hit) : GuidedBsdf(bsdf);
  if (guided.guided()) ++guidedCount;
  const bool splits = aids_.splits > 1 && !path.isBranch && bsdf.hasNonDelta();
  path.directions = splits ? aids_.splits : 1;
  if (bsdf.hasNonDelta()) sampleLights(p, ray, guided, firstNonSpecular && path.featuresDone);
  return splits ? split(p, hit, guided, twoSided) : scatter(path, hit, guided, twoSided, block_[ray]);
}

}  // namespace braid
