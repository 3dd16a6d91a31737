// SPDX-License-Identifier: Apache-2.0
// The path tracer, narrated once: estimates the radiance arriving at a raster position, L = Σ over path lengths of
//
//   throughput · emission,   throughput = Π f(wo, wi) |cos| / pdf(wi),
//
// where the light at each vertex is found in two ways, by sampling a light and by the BSDF direction hitting one,
// weighted by the power heuristic (Veach 1997). Both ways pass panes (visibility.h), which are no vertices. Other
// integrators follow the same conventions for hits, media, null interfaces, panes and termination.
#pragma once

#include "integrators/camera_paths.h"
#include "integrators/guiding/guide_record.h"
#include "integrators/likely_features.h"
#include "integrators/path_state.h"
#include "renderer/session/integrator.h"
#include "renderer/transport/visibility.h"

namespace braid {

// Light found at a vertex, not yet known to be visible.
struct ShadowRay {
  RayQuery ray;
  float index;            // of refraction, where it runs
  Spectrum contribution;  // to the path's radiance if nothing lies between
  bool forFeatures;       // also the visibility feature
  bool direct;            // of the first non-specular vertex
};

// The random numbers of one of `count` light samples of a vertex.
struct LightChoice {
  float select;
  Vec2 place;
  float count;
};
// The k-th: a lattice that the block's numbers shift, so that the samples differ in their lights and places.
LightChoice lightChoice(const SampleBlock& block, int k = 0, int count = 1);

// As a hit asks for light.
inline Receiver receiverAt(const Hit& hit, bool twoSided) {
  return {hit.position, twoSided ? hit.ng : hit.frame.n, twoSided, hit.time};
}

// What is found out before the first pass about how paths are best sampled.
struct PathAids {
  const Guide* guide = nullptr;  // directions are sampled with it, too; null: by BSDFs alone
  int lightSamples = 1;          // at the first surface that is no mirror
  int splits = 1;                // directions that a path goes on in from there
  // Their points, in the order of the directions; none: hashed numbers.
  std::span<const PassSampler> branches{};
};

// The pass whose points branch k of n of a path of this pass has: branches of all passes fill a sequence of a bucket.
inline uint64_t branchPass(uint64_t pass, uint64_t k, uint64_t n) {
  return (pass / kSequenceBuckets * n + k) * kSequenceBuckets + pass % kSequenceBuckets;
}

// How many paths go on from the first surface whose refraction depends on colour.
inline int coloursOf(const Scene& scene) { return scene.traits().has(kTraitDispersion) ? 3 : 1; }

// Sees the steps of a path, for replay; of a path that is split, those of its branches in turn.
class PathObserver {
 public:
  virtual ~PathObserver() = default;
  virtual void onRay(const PathState& path) = 0;
  virtual void onMiss() = 0;
  virtual void onHit(const Hit& hit) = 0;
  virtual void onScattering(const PathState&) {}  // within a medium; it has the new direction
  virtual void onLight(const ShadowRay& ray, bool visible) = 0;
};

// Traces many paths in step: all find their next surface, then all are shaded, then all shadow rays run. Shading one
// path does not wait for another's memory or divisions, which a path followed alone would; the result
// of a path does not depend on its companions.
class PathKernel {
 public:
  PathKernel(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
             std::vector<RecordedRay>* record, const Roulette& roulette = {})
      : context_(context),
        scene_(context.scene),
        plan_(plan),
        sampler_(sampler),
        record_(record),
        roulette_(roulette),
        wantFeatures_(plan.kept.features),
        filtered_(context.scene.accel().filtered()),
        walk_(context.scene, sampler),
        cameraMedia_(mediaOfCamera(context.scene, plan.camera)),
        path_(static_cast<size_t>(kBatch * coloursOf(scene_))),
        sample_(kBatch),
        likely_(context, plan, sampler),
        shadowRays_(context) {}

  // Starts a path through pixel (x, y) of the full frame with the random numbers of `key`. At most kBatch before a
  // run().
  void start(int x, int y, uint64_t key) { startAt(timeOf(x, y, key), x, y, key); }
  // Follows all started paths to their ends; their samples are then in the order of start().
  void run();
  const PathSample& sample(int i) const { return sample_[static_cast<size_t>(i)]; }
  void clear() { count_ = 0; }
  void observe(PathObserver* observer) { observer_ = observer; }
  void use(const PathAids& aids);
  // Every vertex is told to the recorder.
  void teach(PathRecorder* recorder) { recorder_ = recorder; }

  uint64_t rayCount = 0, shadowRayCount = 0, missCount = 0;
  uint64_t guidedCount = 0;  // vertices with a guide

 protected:
  float timeOf(int x, int y, uint64_t key) const;
  void startAt(float time, int x, int y, uint64_t key);
  void queueRay(int slot, PathState& path);
  void traceActive();
  void shadeActive();
  void traceShadows();
  // Hits, random numbers and lights of all active paths whose rays hit something.
  void prepareShading();
  void pickLights();
  int lightSamplesOf(const PathState& path) const { return path.bounces == 0 ? aids_.lightSamples : 1; }
  // One step of a path from the hit of a ray; true when it goes on. Shadow rays are appended.
  bool shade(int p, size_t ray);
  bool shadeSurface(int p, size_t ray);
  bool shadeColours(int p, size_t ray);
  void addEnvironment(const PathState& path, PathSample& sample) const;
  void addEmission(const PathState& path, const Hit& hit, PathSample& sample) const;
  void addUnlit(PathState& path, const Hit& hit, PathSample& sample) const;
  void add(const Spectrum& radiance, bool direct, PathSample& sample) const;
  bool crossNullInterface(PathState& path, const Hit& hit) const;
  bool passPane(PathState& path, const Hit& hit, const Spectrum& weight) const;
  // Takes a path to the end of its ray through a medium that scatters; `hit` is null where it met nothing.
  Flight finishFlight(PathState& path, const Hit* hit) const;
  bool sampleLight(const PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided,
                   const LightChoice& choice, ShadowRay& shadow) const;
  bool connectLight(const PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided,
                    const LightSample& light, ShadowRay& shadow) const;
  void sampleLights(int p, size_t ray, const GuidedBsdf& bsdf, bool forFeatures);
  bool split(int p, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided);
  void addBranches();
  bool scatter(PathState& path, const Hit& hit, const GuidedBsdf& bsdf, bool twoSided, const SampleBlock& block) const;
  bool turn(PathState& path, const Hit& hit, const Bsdf& bsdf, bool twoSided, const BsdfSample& sample) const;
  void recordFeatures(PathState& path, const Hit& hit, const Bsdf& bsdf, PathSample& sample) const;

  const TransportContext& context_;
  const Scene& scene_;
  const Plan& plan_;
  const PassSampler& sampler_;
  std::vector<RecordedRay>* record_;
  PathObserver* observer_ = nullptr;
  PathAids aids_;
  PathRecorder* recorder_ = nullptr;
  Roulette roulette_;
  bool wantFeatures_, filtered_;
  RandomWalk walk_;
  MediaStack cameraMedia_;  // the solids that the camera is inside of

  int count_ = 0;
  // Those of the camera come first, then those that go on from a split and in other colours.
  std::vector<PathState> path_;
  std::vector<PathSample> sample_;  // branch k of path i adds to one of its own, so that sums have one order
  std::array<bool, kBatch> isSplit_;
  std::array<CameraStart, kBatch> start_;
  LikelyFeatures likely_;
  std::vector<int> waiting_, free_;  // paths that are not active yet; places of path_
  RayBatch rays_;                    // in the order of active_, like their hits
  std::array<RayHit, kBatch> query_;
  std::array<Hit, kBatch> hit_;
  std::array<SampleBlock, kBatch> block_;
  // Where there is a hierarchy of lights: what it has picked, and the first pick of a ray's vertex.
  std::vector<LightQuery> picked_;
  std::array<size_t, kBatch> firstPicked_;
  std::array<int, kBatch> active_;  // indices of the paths that go on
  int activeCount_ = 0;
  VisibilityBatch shadowRays_;
  std::array<ShadowRay, kBatch> shadow_;
  std::array<int, kBatch> shadowPath_;
  int shadowCount_ = 0;
};

}  // namespace braid
