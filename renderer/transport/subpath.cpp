// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/subpath.h"

#include <algorithm>
#include <memory>

namespace braid {

namespace {

constexpr int kMaxNullCrossings = 256;
constexpr double kMinCosine = 1e-8;

double geometricCosine(const Hit& hit, const Vec3& direction) {
  return std::max(static_cast<double>(std::abs(glm::dot(direction, hit.ng))), kMinCosine);
}

// Adjoint BSDF under shading normals: light coming along wo leaves along wi by f |wo·ns| |wi·ng| / (|wo·ng| |wi·ns|)
// (Veach 1997, eq. 5.19).
float adjointFactor(const SubpathVertex& v, float wiShading, float wiGeometric) {
  const float down = std::abs(glm::dot(v.hit.wo, v.hit.ng)) * std::abs(wiShading);
  const float up = std::abs(v.wo.z) * std::abs(wiGeometric);
  return down > 0 ? up / down : 0.0f;
}

}  // namespace

VertexValue evaluateVertex(const TransportContext& context, const SubpathVertex& vertex, Transport transport,
                           const Vec3& wi) {
  VertexValue value;
  Vec3 local = vertex.hit.frame.toLocal(wi);
  const float geometric = glm::dot(wi, vertex.hit.ng);
  const bool reflects = geometric > 0;
  if (!reflects && !vertex.twoSided) return value;
  const bool below = reflects != (local.z > 0);
  float shading = local.z;
  if (below) {
    // TRAP: the light's side must agree with both normals; the camera's side is lifted, as Bsdf does with wo.
    if (transport == Transport::Radiance) return value;
    local.z = std::copysign(std::max(std::abs(local.z), 1e-4f), reflects ? 1.0f : -1.0f);
    local = glm::normalize(local);
    shading = local.z;
  }
  const BsdfValue b = vertex.bsdf.evaluate(local, true);
  if (isBlack(b.f)) return value;
  value.f = b.f;
  value.pdfW = b.pdfW;
  value.pdfRevW = b.pdfRevW;
  if (transport == Transport::Power) {
    value.f *= adjointFactor(vertex, shading, geometric);
    if (below) value.pdfW = 0;  // no walk from a light leaves below the horizon
  } else if (vertex.woBelow) {
    value.pdfRevW = 0;
  }
  value.cosGeometric = static_cast<float>(geometricCosine(vertex.hit, wi));
  value.media = vertex.media;
  if (!reflects && context.summaryOf(vertex.hit).volume) value.media.cross(vertex.hit.mesh->material, vertex.hit.front);
  return value;
}

SubpathBatch::SubpathBatch(const TransportContext& context, const PassSampler& sampler, const WalkSettings& settings)
    : context_(context),
      scene_(context.scene),
      sampler_(sampler),
      settings_(settings),
      filtered_(context.scene.accel().filtered()),
      walk_(context.scene, sampler) {}

void SubpathBatch::startCamera(uint64_t key, const Camera::CameraRay& ray, const MediaStack& media, double pdfPixel,
                               double lightPaths, bool orthographic) {
  BRAID_ASSERT(count_ < kBatch);
  SubpathState& s = *std::construct_at(&state_[static_cast<size_t>(count_++)]);
  s.key = key;
  s.origin = ray.origin;
  s.direction = ray.direction;
  s.time = ray.time;
  s.media = media;
  s.channel = channelOf(scene_, sampler_, key);
  s.byDistance = !orthographic;
  if (settings_.mis) s.mis.vcm = sqr(lightPaths / pdfPixel);  // (31)
}

void SubpathBatch::startLight(uint64_t key, const LightStart& start, const MediaStack& media) {
  BRAID_ASSERT(count_ < kBatch);
  SubpathState& s = *std::construct_at(&state_[static_cast<size_t>(count_++)]);
  s.key = key;
  s.origin = start.finite && !start.delta
                 ? offsetOrigin(start.position, start.positionError, start.normal, start.direction)
                 : start.position;
  s.direction = start.direction;
  s.time = start.time;
  s.throughput = start.throughput;
  s.startThroughput = maxComponent(start.throughput);
  s.media = media;
  s.channel = channelOf(scene_, sampler_, key);
  s.byDistance = start.finite;
  s.light = start.light;
  s.pdfEmit = start.pdfEmit;
  s.cosLight = start.cosLight;
  s.deltaLight = start.delta;
  if (settings_.deltaChains && !start.delta)
    s.chain = sqr(static_cast<double>(start.cosLight) / static_cast<double>(start.pdfEmit));
}

void SubpathBatch::startLight(uint64_t key, const LightEmission& emission, double select, const SampleBlock& u,
                              float time) {
  LightStart start;
  if (emission.sample(select, {u.u[slot::kLightU], u.u[slot::kLightV]}, {u.u[slot::kBsdfU], u.u[slot::kBsdfV]}, time,
                      start))
    startLight(key, start, emission.mediaAt(start));
  else
    startNothing();
}

void SubpathBatch::startNothing() {
  BRAID_ASSERT(count_ < kBatch);
  SubpathState& s = *std::construct_at(&state_[static_cast<size_t>(count_++)]);
  s.throughput = Spectrum(0);
}

void SubpathBatch::queueRay(int slot, SubpathState& state) {
  const float reach = walk_.any() ? walk_.begin(state) : kInfinity;
  if (filtered_) {
    const bool camera = settings_.transport == Transport::Radiance && state.fromCamera();
    const uint32_t salt = sampler_.salt(state.key, state.block() + static_cast<uint32_t>(state.nullCrossings) +
                                                       (static_cast<uint32_t>(state.walk.rays) << 12));
    state.salt = (salt & ~kCameraRay) | (camera ? kCameraRay : 0);
  }
  rays_.set(slot, {state.origin, state.direction, reach, state.salt, state.time});
}

int SubpathBatch::queueAll() {
  int active = 0;
  for (int i = 0; i < count_; ++i) {
    if (isBlack(state_[static_cast<size_t>(i)].throughput)) continue;
    active_[static_cast<size_t>(active)] = i;
    queueRay(active++, state_[static_cast<size_t>(i)]);
  }
  return active;
}

void SubpathBatch::trace(int active) {
  const auto state = [&](int a) -> const SubpathState& {
    return state_[static_cast<size_t>(active_[static_cast<size_t>(a)])];
  };
  scene_.accel().intersect(rays_, active, queries_.data());
  rayCount += static_cast<uint64_t>(active);
  for (int a = 0; a < active; ++a) {
    const RayHit& query = queries_[static_cast<size_t>(a)];
    if (query.t < kInfinity) makeHit(scene_, query, state(a).direction, hits_[static_cast<size_t>(a)]);
  }
}

SubpathBatch::Arrival SubpathBatch::arrive(SubpathState& state, const Hit& hit, MisQuantities& here) const {
  if (!state.walk.medium) state.throughput *= mediaTransmittance(scene_, state.media, hit.distance);
  state.travelled += hit.distance;
  const MaterialSummary& material = context_.summaryOf(hit);
  if (settings_.transport == Transport::Power) {
    if (material.unlit || !applyRange(state, hit.position)) return Arrival::End;
  }
  if (settings_.mis) here = quantitiesAt(state, hit);
  if (settings_.deltaChains) state.chain /= sqr(geometricCosine(hit, hit.wo));
  if (material.volume && crossNullInterface(state, hit, here))
    return state.nullCrossings < kMaxNullCrossings ? Arrival::Null : Arrival::End;
  return Arrival::Vertex;
}

// The window of a light with a range: light samples count the whole straight way to a receiver, also through panes and
// null interfaces, so walks that go straight on replace what they have counted before. False: beyond the range.
bool SubpathBatch::applyRange(SubpathState& state, const Vec3& position) const {
  const LightSampler& lights = context_.lights;
  if (!state.straight || state.light < lights.firstPositional() || state.light >= lights.firstDirectional())
    return true;
  const PunctualLight& light = lights.positional(state.light);
  if (!(light.range < kInfinity)) return true;
  const float window = rangeWindow(light, glm::length(position - placeAt(light, state.time).position));
  if (!(window > 0)) return false;
  state.throughput *= window / state.window;
  state.window = window;
  return true;
}

// The conversion to area.
MisQuantities SubpathBatch::quantitiesAt(const SubpathState& state, const Hit& hit) const {
  MisQuantities m = state.mis;
  if (settings_.transport == Transport::Power && state.atStart) {
    // (31)-(33), here and not at the start because the density of choosing the light depends on where its path arrives.
    const bool twoSided = (context_.summaryOf(hit).lobes & kTransmittingLobes) != 0;
    const Receiver at{hit.position, twoSided ? hit.ng : hit.frame.n, twoSided, hit.time};
    const float direct = context_.lights.pdfDirect(state.light, at, -state.direction);
    const double emit = static_cast<double>(state.pdfEmit);
    m.vcm = sqr(static_cast<double>(direct) / emit);
    m.vc = state.deltaLight ? 0.0 : sqr(static_cast<double>(state.cosLight) / emit);
    m.vm = m.vc * settings_.connectWeight;
  }
  const double inverse = 1 / sqr(geometricCosine(hit, hit.wo));
  if (!state.atStart || state.byDistance) m.vcm *= sqr(sqr(static_cast<double>(state.passed + hit.distance)));
  m.vcm *= inverse;
  m.vc *= inverse;
  m.vm *= inverse;
  return m;
}

// A walk through a medium is one vertex that nothing connects to, like delta scattering: the first of its events is
// that vertex, and the others change nothing more.
Flight SubpathBatch::finishFlight(SubpathState& state, const Hit* hit) const {
  const Flight flight = walk_.finish(state, hit);
  if (flight != Flight::Surface) state.lightCouldNotBeSampled = true;
  if (flight != Flight::Scattered) return flight;
  const bool power = settings_.transport == Transport::Power;
  state.travelled += state.walk.flight;
  if (power && !applyRange(state, state.origin)) return Flight::Absorbed;
  if (settings_.mis) {
    if (power && state.atStart) {
      state.mis.vc =
          state.deltaLight ? 0.0 : sqr(static_cast<double>(state.cosLight) / static_cast<double>(state.pdfEmit));
      state.mis.vm = state.mis.vc * settings_.connectWeight;
    }
    state.mis.vcm = 0;
  }
  if (!state.walked) ++state.deltaRun;
  state.walked = true;
  state.leastPdfW = 0;
  state.atStart = state.throughPane = state.straight = false;
  state.passed = 0;
  return flight;
}

// As in the path tracer: inside of a solid that rules there, another solid's surface scatters nothing.
bool SubpathBatch::crossNullInterface(SubpathState& state, const Hit& hit, const MisQuantities& here) const {
  if (!isNullInterface(scene_, state.media, hit)) return false;
  state.media.cross(hit.mesh->material, hit.front);
  state.origin = offsetOrigin(hit, state.direction);
  state.lightCouldNotBeSampled = true;
  state.atStart = false;
  state.passed = 0;
  ++state.nullCrossings;
  if (settings_.deltaChains) state.chain *= sqr(geometricCosine(hit, state.direction));
  if (settings_.mis) {
    const double cosine2 = sqr(geometricCosine(hit, state.direction));
    state.mis = {0, here.vc * cosine2, here.vm * cosine2};
  }
  return true;
}

// Straight on through a pane: all but the throughput stays that of the last vertex. False: nothing gets through.
bool SubpathBatch::pass(SubpathState& state, const Hit& hit, const Spectrum& weight) const {
  state.throughput *= weight;
  if (isBlack(state.throughput)) return false;
  state.origin = offsetOrigin(hit, state.direction);
  state.passed += hit.distance;
  state.throughPane = true;
  if (settings_.deltaChains) state.chain *= sqr(geometricCosine(hit, state.direction));
  return ++state.panes < kMostPanes;
}

void SubpathBatch::finishVertex(const SubpathState& state, const Hit& hit, SubpathVertex& vertex) const {
  vertex.hit = hit;
  vertex.throughput = state.throughput;
  vertex.media = state.media;
  vertex.key = state.key;
  vertex.block = state.block();
  vertex.segments = state.segments;
  vertex.travelled = state.travelled;
  vertex.twoSided = (context_.summaryOf(hit).lobes & kTransmittingLobes) != 0;
  vertex.woBelow = !(vertex.wo.z > 0);
  vertex.deltaOnly = state.deltaOnly;
  vertex.leastLobe = state.leastLobe;
  vertex.walked = state.walked;
}

bool SubpathBatch::scatter(SubpathState& state, const SubpathVertex& vertex) const {
  const bool power = settings_.transport == Transport::Power;
  const Hit& hit = vertex.hit;
  if (power && vertex.woBelow) return pass(state, hit, vertex.bsdf.straightTransmittance());
  const SampleBlock block = sampler_.block(state.key, state.block() + (power ? 1u : 0u));
  BsdfSample sample;
  const float lobe = settings_.likelyLobes ? 0.5f : block.u[slot::kLobe];
  if (!vertex.bsdf.sample(lobe, {block.u[slot::kBsdfU], block.u[slot::kBsdfV]}, sample)) return false;
  if (!(sample.straight ? pass(state, hit, sample.weight) : turn(state, vertex, sample))) return false;
  if (sample.delta) state.leastLobe = std::min(state.leastLobe, sample.pdfW);

  const float relative = maxComponent(state.throughput) / (state.startThroughput * state.etaScale);
  const float survival = settings_.roulette.survival(state.segments, relative);
  if (survival < 1) {
    if (!(block.u[slot::kRoulette] < survival)) return false;
    state.throughput /= survival;
  }
  if (!sample.straight) ++state.segments;
  return true;
}

bool SubpathBatch::turn(SubpathState& state, const SubpathVertex& vertex, const BsdfSample& sample) const {
  const bool power = settings_.transport == Transport::Power;
  const Hit& hit = vertex.hit;
  const Vec3 direction = renormalize(hit.frame.toWorld(sample.wi));
  const float geometric = glm::dot(direction, hit.ng);
  if ((geometric > 0) == sample.transmitted) return false;
  state.throughput *= sample.weight;
  if (power) state.throughput *= adjointFactor(vertex, sample.wi.z, geometric);
  if (isBlack(state.throughput)) return false;

  if (sample.transmitted && hit.material->hasVolume()) {
    const float eta = crossInterface(scene_, state.media, hit);
    if (!power) state.etaScale *= sqr(eta);
  }
  if (settings_.mis) {
    const double cosine = geometricCosine(hit, direction);
    MisQuantities m = vertex.mis;
    if (sample.delta) {  // (53)-(55)
      m = {0, m.vc * sqr(cosine), m.vm * sqr(cosine)};
    } else {  // (34)-(36)
      const double forward = static_cast<double>(sample.pdfW);
      double reverse = static_cast<double>(vertex.bsdf.evaluate(sample.wi, true).pdfRevW);
      if (!power && vertex.woBelow) reverse = 0;
      const double ratio = sqr(cosine / forward);
      m.vc = ratio * (m.vc * sqr(reverse) + m.vcm + settings_.mergeWeight);
      m.vm = ratio * (m.vm * sqr(reverse) + m.vcm * settings_.connectWeight + 1);
      m.vcm = sqr(1 / forward);
    }
    state.mis = m;
  }
  state.deltaRun = sample.delta ? state.deltaRun + 1 : 0;
  if (settings_.deltaChains) {
    const double cosine2 = sqr(geometricCosine(hit, direction));
    state.chain = sample.delta ? state.chain * cosine2 : cosine2 / sqr(static_cast<double>(sample.pdfW));
  }
  state.origin = offsetOrigin(hit, direction);
  state.direction = direction;
  state.lastPosition = hit.position;
  state.lastNormal = vertex.receiverNormal();
  state.lastTwoSided = vertex.twoSided;
  state.lastPdfW = sample.pdfW;
  state.lightCouldNotBeSampled = sample.delta;
  state.deltaOnly = state.deltaOnly && sample.delta;
  if (!sample.delta) state.leastPdfW = std::min(state.leastPdfW, sample.pdfW);
  state.atStart = state.throughPane = state.straight = state.walked = false;
  state.passed = 0;
  return true;
}

}  // namespace braid
