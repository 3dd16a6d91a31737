// SPDX-License-Identifier: Apache-2.0
#include "integrators/bidirectional/bidirectional.h"

#include <algorithm>

#include "integrators/camera_paths.h"
#include "integrators/tiles.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/transport/shadow_ray.h"

namespace braid {

namespace {

// Light subpaths are connected to much of the image: few that carry much would leave bright spots.
constexpr Roulette kRoulette{2, 0.5f};
// Connections that promise less than this share of what the path's connections have promised so far are decided by
// Russian roulette: their shadow rays would cost more than they tell (Veach 1997, section 10.3.3).
constexpr float kVisibilityThreshold = 0.1f;

double square(float x) { return sqr(static_cast<double>(x)); }

float hashToUnit(uint64_t key, uint32_t a, uint32_t b) {
  const uint32_t h = mix32(mix32(static_cast<uint32_t>(key >> 32) ^ (a * 0x9e3779b9u)) ^
                           mix32(static_cast<uint32_t>(key) + b * 0x85ebca6bu));
  return static_cast<float>(h >> 8) * 0x1p-24f;
}

}  // namespace

WalkSettings bidirectionalWalk(const Plan& plan, Transport transport, const Merging* merging) {
  WalkSettings s;
  s.transport = transport;
  // The last segment of a light subpath's path is the connection.
  s.maxSegments = transport == Transport::Power ? plan.settings.maxDepth - 1 : plan.settings.maxDepth;
  s.roulette = kRoulette;
  if (merging) {
    s.connectWeight = merging->connectWeight;
    s.mergeWeight = merging->mergeWeight;
  }
  return s;
}

void renderTile(BidirectionalKernel& kernel, const PixelWindow& tile) {
  std::vector<std::pair<int, int>> pixels;
  for (int y = tile.y0; y < tile.y1; ++y)
    for (int x = tile.x0; x < tile.x1; ++x) {
      pixels.emplace_back(x, y);
      if (pixels.size() < kBatch && !(x == tile.x1 - 1 && y == tile.y1 - 1)) continue;
      kernel.render(pixels);
      pixels.clear();
    }
}

void LightPaths::start(SubpathBatch& batch, uint64_t item) const {
  const uint64_t key = sampler.itemKey(item);
  const SampleBlock u = sampler.block(key, 1);
  const double select =
      static_cast<double>(u.u[slot::kLightSelect]) + static_cast<double>(u.u[slot::kRoulette]) * 0x1p-24;
  LightStart start;
  if (emission.sample(select, {u.u[slot::kLightU], u.u[slot::kLightV]}, {u.u[slot::kBsdfU], u.u[slot::kBsdfV]}, start))
    batch.startLight(key, start, emission.mediaAt(start.light));
  else
    batch.startNothing();
}

void ConnectionQueue::flush() {
  rays_.trace(count_);
  rayCount += static_cast<uint64_t>(count_);
  for (int i = 0; i < count_; ++i) {
    if (rays_.hidden(i)) continue;
    Entry& entry = entries_[static_cast<size_t>(i)];
    rays_.attenuate(i, entry.value);
    deliver_(entry);
  }
  count_ = 0;
}

BidirectionalKernel::BidirectionalKernel(const PassRequest& request, const LightPaths& lights,
                                         const PassSampler& eyeSampler, const MediaStack& cameraMedia,
                                         PassTarget& target, StrategyObserver* observer, const Merging* merging)
    : request_(request),
      context_(request.context),
      scene_(request.context.scene),
      plan_(request.plan),
      lights_(lights),
      eyeSampler_(eyeSampler),
      cameraMedia_(cameraMedia),
      target_(target),
      observer_(observer),
      merging_(merging),
      mergeWeight_(merging ? merging->mergeWeight : 0.0),
      light_(request.context, lights.sampler, bidirectionalWalk(request.plan, Transport::Power, merging)),
      eye_(request.context, eyeSampler, bidirectionalWalk(request.plan, Transport::Radiance, merging)),
      queue_(request.context, [this](const ConnectionQueue::Entry& e) { deliver(e); }) {}

void BidirectionalKernel::render(const std::vector<std::pair<int, int>>& pixels) {
  pixels_ = &pixels;
  const auto item = [&](const std::pair<int, int>& p) { return pixelItem(plan_, p.first, p.second); };
  light_.clear();
  eye_.clear();
  for (size_t i = 0; i < pixels.size(); ++i) {
    stored_[i].clear();
    sample_[i] = PathSample();
    featuresDone_[i] = false;
    candidates_[i] = 0;
    lights_.start(light_, item(pixels[i]));
  }
  if (plan_.settings.maxDepth > 1)
    light_.run([&](int i, const SubpathState&, const SubpathVertex& v) { return storeLightVertex(i, v); },
               [](int, const SubpathState&) {});

  const Camera& camera = plan_.camera;
  for (const std::pair<int, int>& p : pixels) {
    const uint64_t key = eyeSampler_.itemKey(item(p));
    const SampleBlock u = eyeSampler_.block(key, 0);
    const Camera::CameraRay ray = cameraRayThrough(plan_, u, p.first, p.second);
    eye_.startCamera(key, ray, cameraMedia_, camera.pixelPdf(ray.direction), lights_.count, camera.orthographic());
  }
  eye_.run([&](int i, const SubpathState& s, const SubpathVertex& v) { return shadeEyeVertex(i, s, v); },
           [&](int i, const SubpathState& s) { addEnvironment(i, s); });
  queue_.flush();
  for (size_t i = 0; i < pixels.size(); ++i)
    storeSample(request_, pixels[i].first, pixels[i].second, sample_[i], target_);
}

void BidirectionalKernel::add(int index, int s, int t, const Spectrum& value) {
  sample_[static_cast<size_t>(index)].radiance += value;
  if (!observer_) return;
  const auto& [x, y] = (*pixels_)[static_cast<size_t>(index)];
  observer_->onContribution(s, t, x, y, value);
}

void BidirectionalKernel::deliver(const ConnectionQueue::Entry& e) {
  if (e.sample >= 0) {
    if (e.forFeatures) sample_[static_cast<size_t>(e.sample)].features.visibility = 1;
    add(e.sample, e.s, e.t, e.value);
    return;
  }
  Spectrum value = e.value;
  if (plan_.settings.clamp > 0) value *= std::min(1.0f, plan_.settings.clamp / std::max(maxComponent(value), 1e-30f));
  target_.splat(e.x - plan_.window.x0, e.y - plan_.window.y0, value);
  if (observer_) observer_->onContribution(e.s, e.t, e.x, e.y, value);
}

Onward BidirectionalKernel::storeLightVertex(int index, const SubpathVertex& vertex) {
  if (observer_) observer_->onVertex(vertex, Transport::Power);
  if (vertex.woBelow || !vertex.bsdf.hasNonDelta()) return Onward::Scatter;
  stored_[static_cast<size_t>(index)].push_back(vertex);
  connectToCamera(vertex);
  return Onward::Scatter;
}

void BidirectionalKernel::connectToCamera(const SubpathVertex& vertex) {
  const Camera& camera = plan_.camera;
  const Vec3& position = vertex.hit.position;
  const std::optional<Vec2> projected = camera.project(position);
  if (!projected) return;
  Vec2 raster = *projected;
  if (plan_.settings.filter != PixelFilter::Box) {
    const auto segments = static_cast<uint32_t>(vertex.segments);
    raster += Vec2(sampleFilter(plan_.settings.filter, hashToUnit(vertex.key, segments, 11)),
                   sampleFilter(plan_.settings.filter, hashToUnit(vertex.key, segments, 12)));
  }
  const PixelWindow& w = plan_.window;
  // TRAP: compared as floats; a point near the camera's plane projects beyond the range of integers.
  if (!(raster.x >= static_cast<float>(w.x0) && raster.x < static_cast<float>(w.x1) &&
        raster.y >= static_cast<float>(w.y0) && raster.y < static_cast<float>(w.y1)))
    return;
  const Camera::CameraRay ray = camera.ray(*projected);
  const float distance =
      camera.orthographic() ? glm::dot(position - ray.origin, ray.direction) : glm::length(position - ray.origin);
  if (!(distance > 0)) return;
  const Vec3 wi = camera.orthographic() ? -ray.direction : (ray.origin - position) / distance;
  const VertexValue v = evaluateVertex(context_, vertex, Transport::Power, wi);
  if (isBlack(v.f)) return;
  const double spread = camera.orthographic() ? 1.0 : square(distance);
  const double pixelPdf = camera.pixelPdf(-wi);
  const double cameraPdfA = pixelPdf * static_cast<double>(v.cosGeometric) / spread;
  const double wLight =  // (46)
      sqr(cameraPdfA / lights_.count) * (mergeWeight_ + vertex.mis.vcm + vertex.mis.vc * square(v.pdfRevW));
  const double factor = pixelPdf / (spread * lights_.count * (1 + wLight));
  const Spectrum value =
      vertex.throughput * v.f * static_cast<float>(factor) * mediaTransmittance(scene_, v.media, distance);
  if (isBlack(value)) return;
  // From the camera, so that culled back faces let it pass as they do camera rays.
  const Vec3 end = offsetOrigin(vertex.hit, wi);
  const uint32_t salt = lights_.sampler.salt(vertex.key, 0x10000u + static_cast<uint32_t>(vertex.segments));
  queue_.add(connectionRay(ray.origin, end, salt | kCameraRay), mediumIndex(scene_, v.media),
             {value, vertex.segments + 1, 1, -1, static_cast<int>(raster.x), static_cast<int>(raster.y)});
}

Onward BidirectionalKernel::shadeEyeVertex(int index, const SubpathState& state, const SubpathVertex& vertex) {
  if (observer_) observer_->onVertex(vertex, Transport::Radiance);
  const MaterialSummary& material = context_.summaryOf(vertex.hit);
  if (material.unlit) {
    addUnlit(index, state, vertex);
    return Onward::End;
  }
  if (material.emissive) addEmission(index, state, vertex);
  bool& featuresDone = featuresDone_[static_cast<size_t>(index)];
  const bool first =
      plan_.kept.features && !featuresDone &&
      recordFeatures(scene_, vertex, plan_.settings.maxDepth, sample_[static_cast<size_t>(index)].features);
  featuresDone = featuresDone || first;
  if (vertex.segments >= plan_.settings.maxDepth) return Onward::Pass;
  if (!vertex.bsdf.hasNonDelta()) return Onward::Scatter;
  sampleLight(index, vertex, first);
  connect(index, vertex);
  if (merging_) merge(index, vertex);
  return Onward::Scatter;
}

// As in the path tracer: shown to the camera and to mirrors only.
void BidirectionalKernel::addUnlit(int index, const SubpathState& state, const SubpathVertex& vertex) {
  bool& done = featuresDone_[static_cast<size_t>(index)];
  const Spectrum color =
      unlitColor(scene_, vertex, plan_.kept.features && !done, sample_[static_cast<size_t>(index)].features);
  done = true;
  if (state.lightCouldNotBeSampled) add(index, 0, vertex.segments + 1, vertex.throughput * color);
}

void BidirectionalKernel::addEmission(int index, const SubpathState& state, const SubpathVertex& vertex) {
  const Hit& hit = vertex.hit;
  if (!hit.front && !hit.material->doubleSided) return;
  const Spectrum radiance = scene_.emission(*hit.mesh, hit.triangle, hit.u, hit.v);
  if (isBlack(radiance)) return;
  double weight = 1;
  const int64_t emitter = scene_.emitterIndex(hit.meshIndex, hit.triangle, hit.instance);
  const float cosLight = glm::dot(hit.wo, hit.ng);
  if (vertex.segments > 1 && emitter >= 0 && cosLight > 0) {
    const auto light = static_cast<uint32_t>(emitter);
    const float direct =
        context_.lights.pdfDirect(light, state.lastPosition, state.lastNormal, state.lastTwoSided, -hit.wo);
    const float emit = lights_.emission.pdfEmit(light, hit.wo, cosLight);
    weight = 1 / (1 + square(direct) * vertex.mis.vcm + square(emit) * vertex.mis.vc);  // (43)
  }
  add(index, 0, vertex.segments + 1, vertex.throughput * radiance * static_cast<float>(weight));
}

void BidirectionalKernel::addEnvironment(int index, const SubpathState& state) {
  PathSample& sample = sample_[static_cast<size_t>(index)];
  const bool fromCamera = state.fromCamera();
  if (fromCamera) sample.coverage = 0;
  Spectrum radiance(0);
  if (fromCamera && plan_.settings.background)
    radiance = *plan_.settings.background;
  else if (scene_.environment())
    radiance = scene_.environment()->radiance(state.direction);
  if (plan_.kept.features && !featuresDone_[static_cast<size_t>(index)]) {
    sample.features.setAlbedo(radiance);
    sample.features.normal = -state.direction;
    sample.features.depth = 0;
  }
  if ((fromCamera && plan_.settings.transparent) || isBlack(radiance)) return;
  double weight = 1;
  if (state.segments > 1) {
    const float direct = context_.lights.pdfEnvironment(state.direction);
    const float emit = lights_.emission.pdfEmit(context_.lights.environmentLight(), -state.direction, 1);
    weight = 1 / (1 + square(direct) * state.mis.vcm + square(emit) * state.mis.vc);
  }
  add(index, 0, state.segments + 1, state.throughput * radiance * static_cast<float>(weight));
}

void BidirectionalKernel::sampleLight(int index, const SubpathVertex& vertex, bool forFeatures) {
  const Hit& hit = vertex.hit;
  const SampleBlock block = eyeSampler_.block(vertex.key, vertex.block);
  LightSample light;
  if (!context_.lights.sample(hit.position, vertex.receiverNormal(), vertex.twoSided, block.u[slot::kLightSelect],
                              {block.u[slot::kLightU], block.u[slot::kLightV]}, light))
    return;
  const VertexValue v = evaluateVertex(context_, vertex, Transport::Radiance, light.wi);
  if (isBlack(v.f)) return;
  float cosLight = 1, directPdf = light.pdfW;
  if (light.light < context_.lights.firstPositional())
    cosLight = std::abs(glm::dot(light.wi, scene_.emitters()[light.light].normal));
  else if (light.light < context_.lights.firstDirectional())
    directPdf *= sqr(light.distance);
  // A surface that glows and transmits may pick a light in its own plane.
  if (!(cosLight > 0)) return;
  const double wLight = light.delta ? 0.0 : square(v.pdfW / directPdf);  // (44)
  const float emit = lights_.emission.pdfEmit(light.light, -light.wi, cosLight);
  const double wCamera =  // (45)
      sqr(static_cast<double>(emit) * static_cast<double>(v.cosGeometric) /
          (static_cast<double>(directPdf) * static_cast<double>(cosLight))) *
      (mergeWeight_ + vertex.mis.vcm + vertex.mis.vc * square(v.pdfRevW));
  const auto weight = static_cast<float>(1 / (1 + wLight + wCamera));
  const Spectrum value = vertex.throughput * v.f * light.radiance * (weight / light.pdfW) *
                         mediaTransmittance(scene_, v.media, light.distance);
  if (isBlack(value)) return;
  const uint32_t salt = eyeSampler_.salt(vertex.key, 0x10000u + static_cast<uint32_t>(vertex.segments)) & ~kCameraRay;
  queue_.add(shadowRay(hit, light.wi, light.distance, salt), mediumIndex(scene_, v.media),
             {value, 1, vertex.segments + 1, index, 0, 0, forFeatures});
}

void BidirectionalKernel::connect(int index, const SubpathVertex& eye) {
  const std::vector<SubpathVertex>& stored = stored_[static_cast<size_t>(index)];
  candidate_.clear();
  float& total = candidates_[static_cast<size_t>(index)];
  for (size_t k = 0; k < stored.size(); ++k) {
    const SubpathVertex& light = stored[k];
    if (eye.segments + light.segments + 1 > plan_.settings.maxDepth) break;
    const Vec3 d = light.hit.position - eye.hit.position;
    const float distance2 = glm::dot(d, d);
    if (!(distance2 > 0)) continue;
    const float distance = std::sqrt(distance2);
    const Vec3 wi = d / distance;
    const VertexValue e = evaluateVertex(context_, eye, Transport::Radiance, wi);
    if (isBlack(e.f)) continue;
    const VertexValue l = evaluateVertex(context_, light, Transport::Power, -wi);
    if (isBlack(l.f)) continue;
    const double inverse2 = 1 / static_cast<double>(distance2);
    const double eyePdfA = static_cast<double>(e.pdfW * l.cosGeometric) * inverse2;
    const double lightPdfA = static_cast<double>(l.pdfW * e.cosGeometric) * inverse2;
    const double wLight = sqr(eyePdfA) * (mergeWeight_ + light.mis.vcm + light.mis.vc * square(l.pdfRevW));  // (40)
    const double wCamera = sqr(lightPdfA) * (mergeWeight_ + eye.mis.vcm + eye.mis.vc * square(e.pdfRevW));   // (41)
    const Spectrum value = eye.throughput * e.f * (light.throughput * l.f) *
                           static_cast<float>(inverse2 / (1 + wLight + wCamera)) *
                           mediaTransmittance(scene_, e.media, distance);
    const float size = maxComponent(value);
    if (!(size > 0)) continue;
    total += size;
    candidate_.push_back({k, value, size, wi, mediumIndex(scene_, e.media)});
  }
  for (const Candidate& c : candidate_) {
    const SubpathVertex& light = stored[c.vertex];
    Spectrum value = c.value;
    const float keep = c.size / (kVisibilityThreshold * total);
    if (keep < 1) {
      if (hashToUnit(eye.key, static_cast<uint32_t>(eye.segments), static_cast<uint32_t>(c.vertex) + 100) >= keep)
        continue;
      value /= keep;
    }
    const Vec3 origin = offsetOrigin(eye.hit, c.direction);
    const Vec3 end = offsetOrigin(light.hit, -c.direction);
    const uint32_t salt = eyeSampler_.salt(
        eye.key, 0x20000u + static_cast<uint32_t>(eye.segments) * 64u + static_cast<uint32_t>(c.vertex));
    queue_.add(connectionRay(origin, end, salt & ~kCameraRay), c.index,
               {value, light.segments + 1, eye.segments + 1, index});
  }
}

void BidirectionalKernel::merge(int index, const SubpathVertex& eye) {
  Spectrum sum(0);
  merging_->grid->query(eye.hit.position, [&](const MergeVertex& light) {
    if (eye.segments + light.segments > plan_.settings.maxDepth) return;
    const VertexValue e = evaluateVertex(context_, eye, Transport::Radiance, light.wo);
    if (isBlack(e.f) || !(light.cosGeometric > 0)) return;
    const double wLight =  // (38)
        light.mis.vcm * merging_->connectWeight + light.mis.vm * square(e.pdfW);
    const double wCamera = eye.mis.vcm * merging_->connectWeight + eye.mis.vm * square(e.pdfRevW);  // (39)
    // Flux per area becomes radiance by the cosine at the surface that it crossed.
    sum += e.f * light.throughput * static_cast<float>(1 / (1 + wLight + wCamera)) / light.cosGeometric;
  });
  if (!isBlack(sum)) add(index, -1, eye.segments + 1, eye.throughput * sum * merging_->normalization);
}

}  // namespace braid
