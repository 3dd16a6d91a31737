// SPDX-License-Identifier: Apache-2.0
// The shift mapping: how a shifted path follows its base path, with the Jacobian in the space of random numbers.
#include "integrators/gdpt/gdpt_kernel.h"

namespace braid {

namespace {

// Rays between two surface points stop this share of their length before the second.
constexpr float kConnectionLength = 1 - 1e-4f;
// Densities that differ more than this are rounding errors; the same range holds for the inverse shift.
constexpr float kMaxJacobian = 1e12f;

bool usable(float jacobian) { return jacobian < kMaxJacobian && jacobian > 1 / kMaxJacobian; }

}  // namespace

// A shift that shares the base path's vertex leaves it in the base path's direction.
void GradientKernel::leaveShared(BasePath& base, ShiftedPath& shift) const {
  const Walker& walker = base.walker;
  Walker& w = shift.walker;
  if (shift.state != Shift::Connected) {
    // Through a pane the density with which it departed still matters for the light that it will find.
    if (base.vertex.passed)
      w.path.throughput = walker.path.throughput;
    else
      shift.state = Shift::Merged;
    if (isBlack(w.prefix * walker.path.throughput)) shift.state = Shift::Failed;
    return;
  }
  shift.state = Shift::Failed;
  const BsdfValue value = bsdfOf(w.surface, w.hit).evaluate(w.hit.frame.toLocal(walker.path.direction));
  if (!(value.pdfW > 0)) return;
  w.path.throughput = value.f / value.pdfW;
  w.path.lastPdfW = value.pdfW;
  shift.jacobian *= value.pdfW / base.vertex.pdfW;
  if (takeRoulette(base.vertex, 1, shift)) shift.state = Shift::Departing;
}

// The variate of Russian roulette is shifted linearly between the intervals in which the two paths survive, so that
// both survive together: Jacobian = ratio of the probabilities. False: the shift carries nothing.
bool GradientKernel::takeRoulette(const Vertex& vertex, float etaRatio, ShiftedPath& shift) {
  Walker& w = shift.walker;
  if (vertex.roulette) {
    const float q = survival(w.path.throughput, etaRatio);
    w.path.throughput /= q;
    shift.jacobian *= q / vertex.survived;
  }
  return usable(shift.jacobian) && !isBlack(w.prefix * w.path.throughput);
}

// Brings the replaying shifts toward one neighbour to the base paths' current vertices and beyond.
void GradientKernel::advanceShifts(int j) {
  std::vector<BasePath*> bases;
  std::vector<Walker*> walkers;
  for (BasePath& base : lanes_)
    if (base.vertex.arrival != Arrival::Nothing && base.shift[j].state == Shift::Replay) {
      bases.push_back(&base);
      walkers.push_back(&base.shift[j].walker);
    }
  if (bases.empty()) return;
  PathSample unused;
  arrive(walkers, std::vector<PathSample*>(walkers.size(), &unused));

  std::array<RayQuery, kBatch> connection;
  std::array<ShiftedPath*, kBatch> lit, connecting;
  int shadows = 0, connections = 0;
  for (BasePath* base : bases) {
    ShadowRay shadow;
    bool connects = false;
    if (shadeShift(*base, j, shadow, connection[static_cast<size_t>(connections)], connects)) {
      shadowRays_.set(shadows, shadow.ray, shadow.index);
      lit[static_cast<size_t>(shadows++)] = &base->shift[j];
    }
    if (connects) connecting[static_cast<size_t>(connections++)] = &base->shift[j];
  }
  traceShadowRays(shadows, true);
  for (int k = 0; k < shadows; ++k) {
    Spectrum& light = lit[static_cast<size_t>(k)]->light;
    shadowRays_.hidden(k) ? void(light = Spectrum(0)) : shadowRays_.attenuate(k, light);
  }
  for (int k = 0; k < connections; ++k) shadowRays_.set(k, connection[static_cast<size_t>(k)], 1);
  traceShadowRays(connections, false);
  for (int k = 0; k < connections; ++k)
    connecting[static_cast<size_t>(k)]->state = shadowRays_.hidden(k) ? Shift::Failed : Shift::Connected;
}

// One vertex of a replaying shift. True: a shadow ray is to be traced; `connects`: the connection to the base path's
// next vertex as well.
bool GradientKernel::shadeShift(BasePath& base, int j, ShadowRay& shadow, RayQuery& connection, bool& connects) {
  const Vertex& vertex = base.vertex;
  ShiftedPath& shift = base.shift[j];
  Walker& w = shift.walker;
  if (w.arrival == Arrival::Nothing || (shift.canReconnect && w.reconnectable())) {
    // Seen from the other side, this path would have been reconnected to.
    pair(base.result, j, vertex.emitted, Spectrum(0), 1, true);
    shift.state = Shift::Failed;
    shift.lightFailed = true;
    return false;
  }
  if (!w.path.fromCamera()) pair(base.result, j, vertex.emitted, w.prefix * w.emitted, shift.jacobian, false);
  fold(w, w);
  if (vertex.arrival != Arrival::Surface || w.arrival != Arrival::Surface) {
    shift.state = Shift::Failed;
    shift.lightFailed = true;
    return false;
  }

  const Bsdf bsdf = bsdfOf(w.surface, w.hit);
  const SampleBlock block = sampler_.block(w.path.key, w.path.block());
  const bool twoSided = transmits(w.surface);
  const bool lit = w.path.segments < plan_.settings.maxDepth && bsdf.hasNonDelta() &&
                   sampleLight(w.path, w.hit, bsdf, twoSided, lightChoice(block), shadow);
  if (lit) shift.light = w.prefix * shadow.contribution;
  if (!vertex.goesOn) return lit;
  shift.canReconnect = vertex.rough && w.rough && vertex.nullCrossings == w.path.nullCrossings &&
                       vertex.panes == w.path.panes;  // as long as the base path
  if (shift.canReconnect && base.walker.reconnectable())
    connects = connect(base, shift, bsdf, connection);
  else if (replay(vertex, shift, bsdf, twoSided, block))
    return lit;
  if (!connects) shift.state = Shift::Failed;
  return lit;
}

bool GradientKernel::replay(const Vertex& vertex, ShiftedPath& shift, const Bsdf& bsdf, bool twoSided,
                            const SampleBlock& block) const {
  Walker& w = shift.walker;
  const float etaScale = w.path.rouletteScale;
  return goOn(w.path, w.hit, bsdf, twoSided, block) && takeRoulette(vertex, w.path.rouletteScale / etaScale, shift);
}

// Turns a shift to the base path's next vertex. False: it cannot see or light it; else `ray` decides.
bool GradientKernel::connect(const BasePath& base, ShiftedPath& shift, const Bsdf& bsdf, RayQuery& ray) const {
  const Hit &target = base.walker.hit, &from = base.vertex.hit;
  Walker& w = shift.walker;
  const Vec3 to = target.position - w.hit.position, baseTo = target.position - from.position;
  const float distance2 = glm::dot(to, to), baseDistance2 = glm::dot(baseTo, baseTo);
  if (!(distance2 > 0 && baseDistance2 > 0)) return false;
  const Vec3 direction = to / std::sqrt(distance2);
  const Vec3 wi = w.hit.frame.toLocal(direction);
  const float cosine = -glm::dot(direction, target.ng);
  const float baseCosine = -glm::dot(baseTo, target.ng) / std::sqrt(baseDistance2);
  if (!(glm::dot(direction, w.hit.ng) > 0 && wi.z > 0 && cosine > 0 && baseCosine > 0)) return false;
  const BsdfValue value = bsdf.evaluate(wi);
  if (!(value.pdfW > 0)) return false;
  w.path.throughput = value.f / value.pdfW;
  shift.jacobian *= value.pdfW * cosine / distance2 / (base.vertex.pdfW * baseCosine / baseDistance2);
  if (!takeRoulette(base.vertex, 1, shift)) return false;

  // Coverage along the way is decided as for the base path's ray.
  ray.origin = offsetOrigin(w.hit, direction);
  ray.direction = offsetOrigin(target, -direction) - ray.origin;
  ray.tmax = kConnectionLength;
  ray.salt = base.walker.path.salt;
  ray.time = base.walker.path.time;

  w.path.direction = direction;
  w.path.lastPosition = w.hit.position;
  w.path.lastNormal = w.hit.frame.n;
  w.path.lastTwoSided = false;
  w.path.lastPdfW = value.pdfW;
  w.path.lightCouldNotBeSampled = false;
  w.path.salt = base.walker.path.salt;
  ++w.path.segments;
  w.hit = target;
  w.hit.wo = -direction;
  w.hit.distance = std::sqrt(distance2);
  w.surface = base.walker.surface;
  PathSample found;
  if (context_.summaryOf(w.hit).emissive) addEmission(w.path, w.hit, found);
  w.emitted = found.radiance;
  return true;
}

}  // namespace braid
