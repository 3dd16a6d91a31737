// SPDX-License-Identifier: Apache-2.0
#include "integrators/gdpt/gdpt_kernel.h"

#include <algorithm>

#include "renderer/core/error.h"
#include "renderer/transport/dispersion.h"

namespace braid {

namespace {

constexpr int kMaxNullCrossings = 256;
// Perceptual roughness from which a surface counts as rough: below it, the lobe is too narrow for a direction that was
// not sampled from it.
constexpr float kRough = 0.3f;
// Russian roulette by the weight of the last scattering alone: after a reconnection that is the same for the base path
// and its shifts, whatever their throughputs. The bound keeps the ratio of two probabilities moderate.
constexpr float kMinSurvival = 0.05f;

bool roughSurface(const SurfaceParameters& s) {
  if (s.lobes == kLobeDiffuse) return true;
  if (s.lobes & kTransmittingLobes) return false;
  const bool coat = (s.lobes & kLobeClearcoat) != 0 && s.clearcoat > 0;
  return s.roughness >= kRough && (!coat || s.clearcoatRoughness >= kRough);
}

}  // namespace

float GradientKernel::survival(const Spectrum& weight, float etaRatio) {
  return std::clamp(maxComponent(weight) / etaRatio, kMinSurvival, 1.0f);
}

bool GradientKernel::transmits(const SurfaceParameters& s) { return (s.lobes & kTransmittingLobes) != 0; }

Bsdf GradientKernel::bsdfOf(const SurfaceParameters& s, const Hit& hit) {
  const Vec3 wo = hit.frame.toLocal(hit.wo);
  return s.lobes == kLobeDiffuse ? Bsdf(s.baseColor, wo) : Bsdf(s, wo);
}

GradientKernel::GradientKernel(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
                               std::vector<RecordedRay>* record)
    : PathKernel(context, plan, sampler, record, {Roulette::kNever}) {
  lanes_.reserve(kBatch);
}

void GradientKernel::start(int x, int y, uint64_t key) {
  BRAID_ASSERT(lanes_.size() < static_cast<size_t>(kBatch));
  const float time = timeOf(x, y, key);
  const auto camera = [&](int px, int py) {
    count_ = 0;
    startAt(time, px, py, key);
    return path_[0];
  };
  BasePath& base = lanes_.emplace_back();
  base.walker.path = camera(x, y);
  base.start = start_[0];
  const PixelWindow& window = plan_.window;
  for (int j = 0; j < kNeighbours; ++j) {
    const int nx = x + kNeighbourX[j], ny = y + kNeighbourY[j];
    if (nx < window.x0 || ny < window.y0 || nx >= window.x1 || ny >= window.y1) continue;
    base.shift[j].walker.path = camera(nx, ny);
    base.shift[j].walker.path.featuresDone = true;
    base.shift[j].state = Shift::Replay;
  }
}

void GradientKernel::run() {
  std::vector<Walker*> walkers;
  std::vector<PathSample*> samples;
  for (BasePath& base : lanes_) {
    walkers.push_back(&base.walker);
    samples.push_back(&base.result.path);
  }
  arrive(walkers, samples);
  const auto arrived = [](const BasePath& base) { return base.walker.arrival != Arrival::Nothing; };
  while (std::any_of(lanes_.begin(), lanes_.end(), arrived)) {
    shadeBases();
    // The base paths go one vertex ahead: whether a shifted path reconnects depends on where they arrive.
    advanceBases();
    for (int j = 0; j < kNeighbours; ++j) advanceShifts(j);
    for (BasePath& base : lanes_) pairLight(base);
  }
  for (BasePath& base : lanes_) likely_.add(base.start, base.result.path);
  rayCount += likely_.run();
}

void GradientKernel::arrive(const std::vector<Walker*>& walkers, const std::vector<PathSample*>& samples) {
  std::array<size_t, kBatch> index;
  int active = 0;
  for (size_t i = 0; i < walkers.size(); ++i) {
    walkers[i]->straight = true;
    index[static_cast<size_t>(active)] = i;
    queueRay(active++, walkers[i]->path);
  }
  while (active > 0) {
    if (record_)
      for (int a = 0; a < active; ++a) record_->push_back({rays_.get(a), false});
    scene_.accel().intersect(rays_, active, query_.data());
    rayCount += static_cast<uint64_t>(active);
    int next = 0;
    for (int a = 0; a < active; ++a) {
      const size_t i = index[static_cast<size_t>(a)];
      if (!meet(*walkers[i], query_[static_cast<size_t>(a)], *samples[i])) continue;
      walkers[i]->straight = false;
      index[static_cast<size_t>(next)] = i;
      queueRay(next++, walkers[i]->path);
    }
    active = next;
  }
}

bool GradientKernel::meet(Walker& walker, const RayHit& query, PathSample& sample) {
  const Spectrum before = sample.radiance;
  sample.radiance = Spectrum(0);
  bool goesOn = false;
  const bool met = query.t < kInfinity;
  if (met) makeHit(scene_, query, walker.path.direction, walker.hit);
  const Flight flight =
      walker.path.walk.medium ? finishFlight(walker.path, met ? &walker.hit : nullptr) : Flight::Surface;
  if (flight == Flight::Scattered || flight == Flight::Absorbed) {
    // The shift replays the walk.
    walker.arrival = Arrival::Nothing;
    goesOn = flight == Flight::Scattered;
  } else if (!met) {
    walker.arrival = Arrival::Sky;
    addEnvironment(walker.path, sample);
  } else {
    if (!walker.path.walk.medium)
      walker.path.throughput *= mediaTransmittance(scene_, walker.path.media, walker.hit.distance);
    if (context_.summaryOf(walker.hit).volume && crossNullInterface(walker.path, walker.hit)) {
      walker.arrival = Arrival::Nothing;
      goesOn = walker.path.nullCrossings < kMaxNullCrossings;
    } else {
      meetSurface(walker, sample);
    }
  }
  walker.emitted = sample.radiance;
  sample.radiance = before;
  return goesOn;
}

void GradientKernel::meetSurface(Walker& walker, PathSample& sample) {
  const MaterialSummary& material = context_.summaryOf(walker.hit);
  if (material.unlit) {
    walker.arrival = Arrival::Unlit;
    addUnlit(walker.path, walker.hit, sample);
    return;
  }
  walker.arrival = Arrival::Surface;
  if (material.emissive) addEmission(walker.path, walker.hit, sample);
  if (material.lobes == kLobeDiffuse) {
    walker.surface.lobes = kLobeDiffuse;
    walker.surface.baseColor = baseColorAt(scene_, walker.hit);
  } else {
    walker.surface = surfaceAt(scene_, walker.hit, material.lobes, walker.path.media, walker.path.channel);
  }
  // Inside of a solid the far side of a connection may lie in another medium.
  walker.rough = walker.path.media.empty() && roughSurface(walker.surface);
}

void GradientKernel::traceShadowRays(int count, bool throughPanes) {
  if (record_)
    for (int k = 0; k < count; ++k) record_->push_back({shadowRays_.get(k), true});
  throughPanes ? shadowRays_.trace(count) : shadowRays_.traceOpaque(count);
  shadowRayCount += static_cast<uint64_t>(count);
}

void GradientKernel::pair(GradientSample& result, int j, const Spectrum& base, const Spectrum& shifted, float jacobian,
                          bool failed) {
  if (failed)
    result.difference[j] -= base;
  else
    result.difference[j] += (shifted * jacobian - base) * (1 / (1 + jacobian));
}

// The light that the rays to the current vertices found, for the base path and the shifts that already follow it.
void GradientKernel::pairEmission(BasePath& base) {
  Walker& walker = base.walker;
  Vertex& vertex = base.vertex;
  const bool fromCamera = walker.path.fromCamera();
  const Spectrum found = walker.prefix * walker.emitted;
  (fromCamera ? base.result.direct : base.result.path.radiance) += found;
  vertex.emitted = fromCamera ? Spectrum(0) : found;
  for (int j = 0; j < kNeighbours; ++j) {
    ShiftedPath& shift = base.shift[j];
    Walker& w = shift.walker;
    if (shift.state == Shift::Absent || shift.state == Shift::Replay) continue;
    if (shift.state == Shift::Failed) {
      pair(base.result, j, vertex.emitted, Spectrum(0), 1, true);
      continue;
    }
    if (shift.state == Shift::Departing) {
      // The same ray as the base path's, but sampled with another density, which the weight of the light depends on.
      PathState path = walker.path;
      path.throughput = w.path.throughput;
      path.lastPdfW = w.path.lastPdfW;
      path.featuresDone = true;
      PathSample found2;
      if (walker.arrival == Arrival::Sky)
        addEnvironment(path, found2);
      else if (walker.arrival == Arrival::Surface && context_.summaryOf(walker.hit).emissive)
        addEmission(path, walker.hit, found2);
      w.emitted = found2.radiance;
    } else if (shift.state == Shift::Merged) {
      w.emitted = walker.emitted;
      w.path.throughput = walker.path.throughput;
    }
    pair(base.result, j, vertex.emitted, w.prefix * w.emitted, shift.jacobian, false);
    fold(w, walker);
  }
  fold(walker, walker);
}

void GradientKernel::fold(Walker& walker, const Walker& at) const {
  walker.prefix *= walker.path.throughput;
  walker.path.throughput = Spectrum(1);
  if (at.arrival == Arrival::Surface) drawColour(context_, at.path.media, at.hit, walker.path.channel, walker.prefix);
}

void GradientKernel::shadeBases() {
  int count = 0;
  for (BasePath& base : lanes_) {
    base.vertex.arrival = base.walker.arrival;
    base.vertex.goesOn = false;
    base.vertex.emitted = base.vertex.light = Spectrum(0);
    for (ShiftedPath& shift : base.shift) {
      shift.light = Spectrum(0);
      shift.lightJacobian = shift.jacobian;
      shift.lightFailed = shift.state == Shift::Failed;
    }
    if (base.vertex.arrival == Arrival::Nothing) continue;
    pairEmission(base);
    if (base.vertex.arrival != Arrival::Surface) continue;
    ShadowRay& shadow = shadow_[static_cast<size_t>(count)];
    if (!shadeBase(base, shadow)) continue;
    shadowRays_.set(count, shadow.ray, shadow.index);
    shadowPath_[static_cast<size_t>(count++)] = static_cast<int>(&base - lanes_.data());
  }
  traceShadowRays(count, true);
  for (int k = 0; k < count; ++k) {
    BasePath& base = lanes_[static_cast<size_t>(shadowPath_[static_cast<size_t>(k)])];
    const bool hidden = shadowRays_.hidden(k);
    if (!hidden && shadow_[static_cast<size_t>(k)].forFeatures) base.result.path.features.visibility = 1;
    const auto see = [&](Spectrum& light) { hidden ? void(light = Spectrum(0)) : shadowRays_.attenuate(k, light); };
    see(base.vertex.light);
    for (ShiftedPath& shift : base.shift) see(shift.light);
  }
}

// Shades the base path and the shifts that share its vertex, which see it from elsewhere (Connected) or not (Merged).
// True: a shadow ray, the same for all of them, is to be traced.
bool GradientKernel::shadeBase(BasePath& base, ShadowRay& shadow) {
  Walker& walker = base.walker;
  Vertex& vertex = base.vertex;
  vertex.hit = walker.hit;
  vertex.rough = walker.rough;
  vertex.nullCrossings = walker.path.nullCrossings;
  vertex.panes = walker.path.panes;
  const Bsdf bsdf = bsdfOf(walker.surface, walker.hit);
  const bool first = wantFeatures_ && !walker.path.featuresDone;
  if (first) recordFeatures(walker.path, walker.hit, bsdf, base.result.path);

  const SampleBlock block = sampler_.block(walker.path.key, walker.path.block());
  const bool twoSided = transmits(walker.surface);
  if (walker.path.segments >= plan_.settings.maxDepth) {
    leaveBase(base, bsdf, twoSided, block);
    return false;
  }
  const bool lit =
      bsdf.hasNonDelta() && sampleLight(walker.path, walker.hit, bsdf, twoSided, lightChoice(block), shadow);
  bool hasShadow = lit;
  if (lit) vertex.light = walker.prefix * shadow.contribution;
  for (ShiftedPath& shift : base.shift) {
    Walker& w = shift.walker;
    if ((shift.state == Shift::Merged || shift.state == Shift::Departing) && lit)
      shift.light = w.prefix * shadow.contribution;
    if (shift.state != Shift::Connected) continue;
    ShadowRay seen;
    if (!sampleLight(w.path, w.hit, bsdfOf(w.surface, w.hit), twoSided, lightChoice(block), seen)) continue;
    shift.light = w.prefix * seen.contribution;
    if (!hasShadow) shadow = seen;
    hasShadow = true;
  }
  shadow.forFeatures = lit && first && walker.path.featuresDone;
  leaveBase(base, bsdf, twoSided, block);
  return hasShadow;
}

bool GradientKernel::goOn(PathState& path, const Hit& hit, const Bsdf& bsdf, bool twoSided,
                          const SampleBlock& block) const {
  return path.segments < plan_.settings.maxDepth ? scatter(path, hit, bsdf, twoSided, block)
                                                 : passPane(path, hit, bsdf.straightTransmittance());
}

void GradientKernel::leaveBase(BasePath& base, const Bsdf& bsdf, bool twoSided, const SampleBlock& block) {
  Walker& walker = base.walker;
  Vertex& vertex = base.vertex;
  const float etaScale = walker.path.rouletteScale;
  // By the surfaces met, which shifts meet in step.
  vertex.roulette = walker.path.block() >= kRouletteStart;
  if (!goOn(walker.path, walker.hit, bsdf, twoSided, block)) return;
  if (isBlack(walker.prefix * walker.path.throughput)) return;
  vertex.survived = 1;
  if (vertex.roulette) {
    vertex.survived = survival(walker.path.throughput, walker.path.rouletteScale / etaScale);
    if (!(block.u[slot::kRoulette] < vertex.survived)) return;
    walker.path.throughput /= vertex.survived;
  }
  vertex.pdfW = walker.path.lastPdfW;
  vertex.goesOn = true;
  vertex.passed = walker.path.panes > vertex.panes;
  for (ShiftedPath& shift : base.shift)
    if (shift.state == Shift::Connected || shift.state == Shift::Departing || shift.state == Shift::Merged)
      leaveShared(base, shift);
}

void GradientKernel::advanceBases() {
  std::vector<Walker*> walkers;
  std::vector<PathSample*> samples;
  for (BasePath& base : lanes_) {
    if (!base.vertex.goesOn) {
      base.walker.arrival = Arrival::Nothing;
      continue;
    }
    walkers.push_back(&base.walker);
    samples.push_back(&base.result.path);
  }
  arrive(walkers, samples);
}

void GradientKernel::pairLight(BasePath& base) {
  if (base.vertex.arrival == Arrival::Nothing) return;
  base.result.path.radiance += base.vertex.light;
  for (int j = 0; j < kNeighbours; ++j) {
    const ShiftedPath& shift = base.shift[j];
    if (shift.state == Shift::Absent) continue;
    pair(base.result, j, base.vertex.light, shift.light, shift.lightJacobian, shift.lightFailed);
  }
}

}  // namespace braid
