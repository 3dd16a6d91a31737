// SPDX-License-Identifier: Apache-2.0
// Random walks from the camera and from the lights, for integrators that store, connect or merge their vertices. They
// carry recursive quantities from which the weight of every way to sample a full path follows in constant time
// (Georgiev 2012, "Implementing Vertex Connection and Merging", technical report: equation numbers below), with squared
// densities, which is Veach's power heuristic with exponent 2.
//
// Conventions that make all ways agree:
//   - densities per area use the geometric normals, BSDF cosines the shading normals;
//   - delta scattering, null interfaces (media.h) and walks through media are vertices that no one can connect to;
//   - a pane is no vertex for light that goes straight on through it: neither densities nor lengths of paths know of
//     it, and shadow rays pass it too (visibility.h). It is an ordinary vertex for all else that its surface does;
//   - the light side must see a surface from the same side by both normals, as for light samples of a path tracer; a
//     camera side below the shading horizon is lifted to it, and no walk from a light can leave that way.
#pragma once

#include <array>
#include <cmath>

#include "renderer/core/error.h"
#include "renderer/core/sampler.h"
#include "renderer/scene/camera.h"
#include "renderer/transport/bsdf/bsdf.h"
#include "renderer/transport/context.h"
#include "renderer/transport/dispersion.h"
#include "renderer/transport/light_emission.h"
#include "renderer/transport/random_walk.h"
#include "renderer/transport/roulette.h"
#include "renderer/transport/visibility.h"

namespace braid {

// dVCM, dVC and dVM of the report (31)-(39); doubles, because squared ratios leave the range of floats.
struct MisQuantities {
  double vcm = 0, vc = 0, vm = 0;
};

struct WalkSettings {
  Transport transport = Transport::Radiance;
  int maxSegments = 32;
  Roulette roulette;
  double connectWeight = 0;  // (1 / etaVCM)² when vertices are merged as well, else 0
  double mergeWeight = 0;    // etaVCM² with etaVCM = π r² · light subpaths, else 0
  bool mis = true;           // false: the quantities are not needed and stay 0
  bool deltaChains = false;  // whether SubpathState::chain is needed
  bool likelyLobes = false;  // lobes are not drawn: the walk takes the one that most would
};

// A surface point that a walk has arrived at.
struct SubpathVertex {
  Hit hit;
  Bsdf bsdf;
  Vec3 wo;                 // hit.wo in the shading frame
  Spectrum throughput{0};  // of the walk up to here, before this BSDF
  MediaStack media;        // on the side of wo
  MisQuantities mis;       // complete for this vertex
  uint64_t key = 0;
  unsigned block = 0;      // of random numbers, of a camera walk
  int segments = 0;        // of the walk up to here
  bool twoSided = false;   // transmits
  float travelled = 0;     // metres since the start of the walk
  bool woBelow = false;    // wo lies below the horizon of the shading normal
  bool deltaOnly = false;  // everything since the start of the walk was delta
  float leastLobe = 1;     // SubpathState::leastLobe
  bool walked = false;     // a medium has scattered it since the last vertex, or since the start

  SubpathVertex(const SurfaceParameters& p, const Vec3& o, Transport t) : bsdf(p, o, t), wo(o) {}
  SubpathVertex(const Spectrum& albedo, const Vec3& o) : bsdf(albedo, o), wo(o) {}
  // The normal by which lights are chosen here.
  const Vec3& receiverNormal() const { return twoSided ? hit.ng : hit.frame.n; }
  Receiver receiver() const { return {hit.position, receiverNormal(), twoSided, hit.time}; }
};

// The BSDF of a vertex toward a direction, for connections.
struct VertexValue {
  Spectrum f{0};  // BSDF · |cos shading|; for light subpaths with the adjoint correction, BSDF · |cos geometric|·…
  float pdfW = 0;          // density with which the walk would go on that way
  float pdfRevW = 0;       // density with which a walk the other way would go back along wo
  float cosGeometric = 0;  // |cos| with the geometric normal
  MediaStack media;        // the solids that the direction leads into
};

// How a walk may go on from a vertex. Pass: only straight on, through a pane.
enum class Onward : uint8_t { End, Pass, Scatter };

struct SubpathState {
  Vec3 origin, direction;
  Spectrum throughput{1};
  MediaStack media;
  PathChannel channel;
  WalkState walk;
  MisQuantities mis;
  uint64_t key = 0;
  int segments = 1;  // including the ray that is under way
  int nullCrossings = 0;
  int panes = 0;             // passed straight
  bool throughPane = false;  // passed one since it scattered
  float passed = 0;          // metres from where it scattered to the last pane since
  float travelled = 0;       // metres since the start
  uint32_t salt = 0;
  float time = 0;
  float startThroughput = 1;
  float etaScale = 1;
  bool byDistance = true;  // densities of the first hit depend on its distance: not for parallel rays
  bool deltaOnly = true;
  bool walked = false;  // a medium has scattered it since the last vertex; counts as one delta scattering event
  int deltaRun = 0;     // delta scattering events since the last other one, or since the start
  // Of those, the ones by surfaces.
  int deltaSurfaces() const { return deltaRun - (walked ? 1 : 0); }
  // Squared density of finding the other end of such a run from there, over that of walking it from here: (cos / pdf)²
  // of what it began with, times the squared ratios of cosines at its vertices. The squared density with which a walk
  // starts at the other end, pdfEmit or that of a BSDF, remains to be multiplied with.
  double chain = 0;
  float leastPdfW = kInfinity;  // of the directions sampled so far; delta ones do not count
  float leastLobe = 1;          // the least probability of the delta lobes taken so far
  bool atStart = true;          // no surface met yet

  // The last vertex that scattered, for the weight of lights that the walk hits.
  Vec3 lastPosition{0}, lastNormal{0};
  bool lastTwoSided = false;
  Receiver lastReceiver() const { return {lastPosition, lastNormal, lastTwoSided, time}; }
  float lastPdfW = 0;                  // of the direction sampled there
  bool lightCouldNotBeSampled = true;  // camera, delta scattering, or a null interface since

  uint32_t light = 0;  // where a light subpath started
  float pdfEmit = 0, cosLight = 1;
  bool deltaLight = false;
  bool straight = true;  // since the light: windows count the distance from there
  float window = 1;      // rangeWindow() as far as the throughput has it

  // Of the random numbers at the surface ahead, of a camera walk.
  unsigned block() const { return static_cast<unsigned>(segments + panes); }
  // Nothing but null interfaces has been met.
  bool fromCamera() const { return segments == 1 && panes == 0; }
};

// Value of a vertex's BSDF toward the unit world direction `wi`; f is zero where nothing can be.
VertexValue evaluateVertex(const TransportContext& context, const SubpathVertex& vertex, Transport transport,
                           const Vec3& wi);

// Walks up to kBatch subpaths in step, as the path tracer's kernel does.
class SubpathBatch {
 public:
  SubpathBatch(const TransportContext& context, const PassSampler& sampler, const WalkSettings& settings);

  // Begin a walk; the index of the walk is the order of these calls since clear(). Dimension blocks: camera walks use
  // block k at their k-th vertex, panes that they pass included, light walks block k + 1 (block 1 belongs to the
  // start).
  // `pdfPixel` is the density of the ray per steradian (perspective) or m² (orthographic), of one pixel; lightPaths the
  // number of light subpaths of the pass.
  void startCamera(uint64_t key, const Camera::CameraRay& ray, const MediaStack& media, double pdfPixel,
                   double lightPaths, bool orthographic);
  void startLight(uint64_t key, const LightStart& start, const MediaStack& media);
  // From the light that `select` picks, by block 1 of the walk's random numbers; a walk that ends at once where nothing
  // is emitted.
  void startLight(uint64_t key, const LightEmission& emission, double select, const SampleBlock& u, float time);
  // A walk that begins with zero throughput and ends at once, to keep indices in step.
  void startNothing();
  void clear() { count_ = 0; }

  // Follows all walks to their ends. onHit(index, state, vertex) → Onward; it sees every surface but null interfaces.
  // Walks of maxSegments still pass panes. onMiss(index, state) when a walk leaves the scene; state.mis is that of the
  // departing ray.
  template <class OnHit, class OnMiss>
  void run(const OnHit& onHit, const OnMiss& onMiss);

  const PassSampler& sampler() const { return sampler_; }
  uint64_t rayCount = 0;

 private:
  enum class Arrival { End, Null, Vertex };
  void queueRay(int slot, SubpathState& state);
  // Begins all walks that carry anything; returns their number.
  int queueAll();
  // Traces the rays of all active walks and fills hits_.
  void trace(int active);
  // Takes a walk to the end of its ray through a medium that scatters; `hit` is null where it met nothing.
  Flight finishFlight(SubpathState& state, const Hit* hit) const;
  // Brings the walk to a hit: attenuation. `here`: the quantities there, state.mis stays that of the departing ray.
  Arrival arrive(SubpathState& state, const Hit& hit, MisQuantities& here) const;
  MisQuantities quantitiesAt(const SubpathState& state, const Hit& hit) const;
  bool applyRange(SubpathState& state, const Vec3& position) const;
  void finishVertex(const SubpathState& state, const Hit& hit, SubpathVertex& vertex) const;
  bool scatter(SubpathState& state, const SubpathVertex& vertex) const;
  // Goes on in a sampled direction.
  bool turn(SubpathState& state, const SubpathVertex& vertex, const BsdfSample& sample) const;
  bool pass(SubpathState& state, const Hit& hit, const Spectrum& weight) const;
  bool crossNullInterface(SubpathState& state, const Hit& hit, const MisQuantities& here) const;

  const TransportContext& context_;
  const Scene& scene_;
  const PassSampler& sampler_;
  WalkSettings settings_;
  bool filtered_;
  RandomWalk walk_;
  int count_ = 0;
  std::array<SubpathState, kBatch> state_;
  std::array<int, kBatch> active_;
  RayBatch rays_;
  std::array<RayHit, kBatch> queries_;
  std::array<Hit, kBatch> hits_;
};

template <class OnHit, class OnMiss>
void SubpathBatch::run(const OnHit& onHit, const OnMiss& onMiss) {
  for (int active = queueAll(); active > 0;) {
    trace(active);
    int alive = 0;
    const auto goOn = [&](int index) {
      active_[static_cast<size_t>(alive)] = index;
      queueRay(alive++, state_[static_cast<size_t>(index)]);
    };
    for (int a = 0; a < active; ++a) {
      const int index = active_[static_cast<size_t>(a)];
      SubpathState& state = state_[static_cast<size_t>(index)];
      const Hit& hit = hits_[static_cast<size_t>(a)];
      const bool met = queries_[static_cast<size_t>(a)].t < kInfinity;
      const Flight flight = state.walk.medium ? finishFlight(state, met ? &hit : nullptr) : Flight::Surface;
      if (flight == Flight::Scattered) goOn(index);
      if (flight == Flight::Scattered || flight == Flight::Absorbed) continue;
      if (!met) {
        onMiss(index, state);
        continue;
      }
      MisQuantities here;
      const Arrival arrival = arrive(state, hit, here);
      if (arrival == Arrival::End) continue;
      if (arrival == Arrival::Vertex) {
        const uint32_t lobes = context_.summaryOf(hit).lobes;
        const Vec3 wo = hit.frame.toLocal(hit.wo);
        drawColour(context_, state.media, hit, state.channel, state.throughput);
        SubpathVertex vertex =
            lobes == kLobeDiffuse
                ? SubpathVertex(baseColorAt(scene_, hit), wo)
                : SubpathVertex(surfaceAt(scene_, hit, lobes, state.media, state.channel), wo, settings_.transport);
        vertex.mis = here;
        finishVertex(state, hit, vertex);
        Onward onward = onHit(index, state, vertex);
        if (onward == Onward::End) continue;
        if (state.segments >= settings_.maxSegments) onward = Onward::Pass;
        if (!(onward == Onward::Pass ? pass(state, hit, vertex.bsdf.straightTransmittance()) : scatter(state, vertex)))
          continue;
      }
      goOn(index);
    }
    active = alive;
  }
}

}  // namespace braid
