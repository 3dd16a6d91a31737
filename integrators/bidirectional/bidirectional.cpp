// SPDX-License-Identifier: Apache-2.0
#include "integrators/bidirectional/bidirectional.h"

#include <algorithm>

#include "integrators/camera_paths.h"
#include "integrators/tiles.h"
#include "renderer/session/path_time.h"

namespace braid {

namespace {

// Light subpaths are connected to much of the image: few that carry much would leave bright spots.
constexpr Roulette kRoulette{2, 0.5f};
double square(float x) { return sqr(static_cast<double>(x)); }

// (43): `direct` and `emit` are the densities with which next-event estimation and light subpaths find the light.
double hitWeight(float direct, float emit, const MisQuantities& mis) {
  return 1 / (1 + square(direct) * mis.vcm + square(emit) * mis.vc);
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

void LightPaths::start(SubpathBatch& batch, uint64_t item, float time) const {
  const uint64_t key = sampler.itemKey(item);
  const SampleBlock u = sampler.block(key, 1);
  const double select =
      static_cast<double>(u.u[slot::kLightSelect]) + static_cast<double>(u.u[slot::kRoulette]) * 0x1p-24;
  batch.startLight(key, emission, select, u, time);
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

BidirectionalKernel::BidirectionalKernel(const PassRequest& request, const BidirectionalPass& pass, PassTarget& target,
                                         StrategyObserver* observer)
    : request_(request),
      context_(request.context),
      scene_(request.context.scene),
      plan_(request.plan),
      lights_(pass.lights),
      eyeSampler_(pass.eyeSampler),
      cameraMedia_(pass.cameraMedia),
      target_(target),
      observer_(observer),
      merging_(pass.merging),
      time_(pass.time),
      mergeWeight_(merging_ ? merging_->mergeWeight : 0.0),
      light_(request.context, lights_.sampler, bidirectionalWalk(request.plan, Transport::Power, merging_)),
      eye_(request.context, eyeSampler_, bidirectionalWalk(request.plan, Transport::Radiance, merging_)),
      likely_(request.context, request.plan, eyeSampler_),
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
    const auto& [x, y] = pixels[i];
    const uint64_t key = eyeSampler_.itemKey(item(pixels[i]));
    pathTime_[i] =
        time_ || !scene_.moves() ? time_.value_or(0) : pixelTime(scene_, plan_, eyeSampler_.block(key, 0), x, y);
    lights_.start(light_, item(pixels[i]), pathTime_[i]);
  }
  if (plan_.settings.maxDepth > 1)
    light_.run([&](int i, const SubpathState&, const SubpathVertex& v) { return storeLightVertex(i, v); },
               [](int, const SubpathState&) {});

  for (size_t i = 0; i < pixels.size(); ++i) startEye(pixels[i].first, pixels[i].second, pathTime_[i]);
  eye_.run([&](int i, const SubpathState& s, const SubpathVertex& v) { return shadeEyeVertex(i, s, v); },
           [&](int i, const SubpathState& s) { addEnvironment(i, s); });
  queue_.flush();
  for (size_t i = 0; i < pixels.size(); ++i)
    likely_.add({pixels[i].first, pixels[i].second, eyeSampler_.itemKey(item(pixels[i])), pathTime_[i]}, sample_[i]);
  likelyRays_ += likely_.run();
  for (size_t i = 0; i < pixels.size(); ++i)
    storeSample(request_, pixels[i].first, pixels[i].second, sample_[i], target_);
}

void BidirectionalKernel::startEye(int x, int y, float time) {
  const uint64_t key = eyeSampler_.itemKey(pixelItem(plan_, x, y));
  const Camera::CameraRay ray = cameraRayThrough(plan_, eyeSampler_.block(key, 0), x, y, time);
  const CameraAt camera(plan_.camera, time);
  eye_.startCamera(key, ray, scene_.moves() ? mediaOfCamera(scene_, *camera, time) : cameraMedia_,
                   camera->pixelPdf(ray.direction), lights_.count, camera->orthographic());
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

Onward BidirectionalKernel::shadeEyeVertex(int index, const SubpathState& state, const SubpathVertex& vertex) {
  if (observer_) observer_->onVertex(vertex, Transport::Radiance);
  const MaterialSummary& material = context_.summaryOf(vertex.hit);
  if (material.unlit) {
    addUnlit(index, state, vertex);
    return Onward::End;
  }
  if (material.emissive) addEmission(index, state, vertex);
  bool& featuresDone = featuresDone_[static_cast<size_t>(index)];
  const bool first = plan_.kept.features && !featuresDone &&
                     recordFeatures(scene_, vertex, plan_.settings.maxDepth, sample_[static_cast<size_t>(index)]);
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
  const Spectrum color = unlitColor(scene_, vertex, plan_.kept.features && !done, sample_[static_cast<size_t>(index)]);
  done = true;
  if (state.lightCouldNotBeSampled) add(index, 0, vertex.segments + 1, vertex.throughput * color);
}

void BidirectionalKernel::addEmission(int index, const SubpathState& state, const SubpathVertex& vertex) {
  const Hit& hit = vertex.hit;
  const Spectrum radiance = emissionAt(scene_, hit);
  if (isBlack(radiance)) return;
  double weight = 1;
  const auto found = vertex.segments > 1 ? lightAt(scene_, hit) : std::nullopt;
  if (found) {
    const float direct = context_.lights.pdfDirect(found->light, state.lastReceiver(), -hit.wo);
    weight = hitWeight(direct, lights_.emission.pdfEmit(found->light, hit.wo, found->cosine, hit.time), vertex.mis);
  }
  add(index, 0, vertex.segments + 1, vertex.throughput * radiance * static_cast<float>(weight));
}

void BidirectionalKernel::addEnvironment(int index, const SubpathState& state) {
  const Spectrum radiance =
      radianceBeyond(scene_, plan_, state.direction, state.fromCamera(), !featuresDone_[static_cast<size_t>(index)],
                     state.leastLobe, sample_[static_cast<size_t>(index)]);
  if (isBlack(radiance)) return;
  double weight = 1;
  if (state.segments > 1) {
    const float emit = lights_.emission.pdfEmit(context_.lights.environmentLight(), -state.direction, 1, state.time);
    weight = hitWeight(context_.lights.pdfEnvironment(state.lastReceiver(), state.direction), emit, state.mis);
  }
  add(index, 0, state.segments + 1, state.throughput * radiance * static_cast<float>(weight));
}

}  // namespace braid
