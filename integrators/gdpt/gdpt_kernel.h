// SPDX-License-Identifier: Apache-2.0
// Traces a base path and its shifts to the four neighbouring pixels. A shifted path replays the random numbers of the
// base path until both can reconnect (integrators/README.md, Gradient-domain path tracing).
//
// Each contribution (light sampled at a vertex; light found by the ray to a vertex) is shifted on its own. TRAP: the
// rule when to reconnect must give the same answer from both sides: the shift fails where the shifted path alone could
// reconnect.
//
// A pane that a path passes is no vertex to its MIS weights and its length, but it is one to the shift mapping: base
// path and shifts pass or meet surfaces in step, and never reconnect through a pane.
#pragma once

#include <vector>

#include "integrators/path_kernel.h"

namespace braid {

inline constexpr int kNeighbours = 4;
// Right, left, below, above; the opposite of j is j ^ 1.
inline constexpr int kNeighbourX[kNeighbours] = {1, -1, 0, 0}, kNeighbourY[kNeighbours] = {0, 0, 1, -1};

struct GradientSample {
  PathSample path;                   // radiance: all that the base path found but `direct`
  Spectrum direct{0};                // what the camera ray itself found: emission, background, unlit surfaces
  Spectrum difference[kNeighbours];  // weighted contributions to neighbour - pixel, without `direct`
};

class GradientKernel : PathKernel {
 public:
  static constexpr unsigned kRouletteStart = 5;  // surface from which base paths are ended at random

  GradientKernel(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
                 std::vector<RecordedRay>* record);

  // Starts a base path and its shifts to those neighbours that lie in the plan's window. At most kBatch before a run().
  void start(int x, int y, uint64_t key);
  void run();
  void clear() { lanes_.clear(); }
  const GradientSample& sample(int i) const { return lanes_[static_cast<size_t>(i)].result; }
  using PathKernel::rayCount;
  using PathKernel::shadowRayCount;

 private:
  // What the last ray of a path met.
  enum class Arrival : uint8_t { Nothing, Sky, Unlit, Surface };
  // Connected: has just been joined to the base path's vertex, which it sees from elsewhere. Departing: leaves it in
  // the base path's direction, with a density of its own, and passes panes with it. Merged: differs by its throughput
  // only.
  enum class Shift : uint8_t { Absent, Failed, Replay, Connected, Departing, Merged };

  // A path at a vertex. path.throughput is that since the vertex before, `prefix` that up to there.
  struct Walker {
    PathState path;
    Spectrum prefix{1};
    Spectrum emitted{0};  // radiance found by the last ray, times path.throughput
    Hit hit;
    SurfaceParameters surface;
    Arrival arrival = Arrival::Nothing;
    bool rough = false;     // can be reconnected from
    bool straight = false;  // no null interface lies on the last segment
    bool reconnectable() const { return arrival == Arrival::Surface && rough && straight; }
  };
  struct ShiftedPath {
    Walker walker;
    Shift state = Shift::Absent;
    bool canReconnect = false;  // replay: the last vertex was rough on both paths
    float jacobian = 1;
    Spectrum light{0};  // sampled at the current vertex, if visible
    float lightJacobian = 1;
    bool lightFailed = false;
  };
  // The base path's current vertex, kept while the path is already at the next one.
  struct Vertex {
    Spectrum emitted{0}, light{0};
    Hit hit;
    Arrival arrival = Arrival::Nothing;
    bool rough = false;
    int nullCrossings = 0, panes = 0;
    bool goesOn = false;
    bool passed = false;  // goes on straight through a pane
    float pdfW = 0;       // of the direction of the next segment
    float survived = 1;   // probability of surviving Russian roulette
    bool roulette = false;
  };
  struct BasePath {
    CameraStart start;
    Walker walker;
    Vertex vertex;
    ShiftedPath shift[kNeighbours];
    GradientSample result;
  };

  // Traces the rays of the walkers until each has met something that is no null interface. `samples` receive features.
  void arrive(const std::vector<Walker*>& walkers, const std::vector<PathSample*>& samples);
  // True: a null interface, the ray goes on.
  bool meet(Walker& walker, const RayHit& query, PathSample& sample);
  void meetSurface(Walker& walker, PathSample& sample);

  // Takes what a path has carried so far into its prefix, at the vertex where the walker `at` is.
  void fold(Walker& walker, const Walker& at) const;

  void shadeBases();
  void pairEmission(BasePath& base);
  bool shadeBase(BasePath& base, ShadowRay& shadow);
  // False: the path ends. At the greatest length of a path it goes on through a pane only.
  bool goOn(PathState& path, const Hit& hit, const Bsdf& bsdf, bool twoSided, const SampleBlock& block) const;
  void leaveBase(BasePath& base, const Bsdf& bsdf, bool twoSided, const SampleBlock& block);
  void leaveShared(BasePath& base, ShiftedPath& shift) const;
  void advanceBases();

  void advanceShifts(int j);
  bool shadeShift(BasePath& base, int j, ShadowRay& shadow, RayQuery& connection, bool& connects);
  bool replay(const Vertex& vertex, ShiftedPath& shift, const Bsdf& bsdf, bool twoSided,
              const SampleBlock& block) const;
  bool connect(const BasePath& base, ShiftedPath& shift, const Bsdf& bsdf, RayQuery& ray) const;
  static bool takeRoulette(const Vertex& vertex, float etaRatio, ShiftedPath& shift);

  static float survival(const Spectrum& weight, float etaRatio);
  static bool transmits(const SurfaceParameters& s);
  static Bsdf bsdfOf(const SurfaceParameters& s, const Hit& hit);
  void traceShadowRays(int count, bool throughPanes);
  static void pairLight(BasePath& base);
  static void pair(GradientSample& result, int j, const Spectrum& base, const Spectrum& shifted, float jacobian,
                   bool failed);

  std::vector<BasePath> lanes_;
};

}  // namespace braid
