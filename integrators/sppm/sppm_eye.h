// SPDX-License-Identifier: Apache-2.0
// The eye half of a photon mapping pass. From the camera a path follows narrow lobes until it picks a broad one; there
// photons are gathered. An eye path never continues beyond a broad vertex, except to see whether it hits a light, and
// no photons but those of caustics are gathered at narrow lobes. Every path of light therefore belongs to exactly one
// estimator (integrators/README.md, Photon mapping).
#pragma once

#include <array>

#include "integrators/path_kernel.h"
#include "integrators/sppm/sppm_gather.h"
#include "renderer/transport/subpath.h"

namespace braid {

class PhotonEyeBatch {
 public:
  // All paths have one time, and the camera is in these media then. `caustics` may be null: the light that they bring
  // is left to hitting lights then.
  PhotonEyeBatch(const TransportContext& context, const Plan& plan, const PassSampler& sampler,
                 const MediaStack& cameraMedia, const CausticMerging* caustics = nullptr, float time = 0);

  // Starts a path through pixel (x, y) of the full frame; at most kBatch before a run().
  void start(int x, int y, uint64_t key);
  // Follows all paths. onGather(index, vertex) is called for at most one vertex of each path, where photons are to be
  // gathered: its BSDF has the broad lobes alone, its throughput is divided by the probability of their choice.
  template <class OnGather>
  void run(const OnGather& onGather) {
    walks_.run(
        [&](int index, SubpathState& state, SubpathVertex& vertex) {
          const Step step = shade(index, state, vertex);
          if (step.gather) onGather(index, static_cast<const SubpathVertex&>(vertex));
          return step.onward;
        },
        [&](int index, const SubpathState& state) { addEnvironment(index, state); });
    traceShadows();
    for (size_t i = 0; i < static_cast<size_t>(count_); ++i) likely_.add(start_[i], sample_[i]);
    likelyRays_ += likely_.run();
  }
  // Without the light gathered at broad lobes, which the caller adds.
  PathSample& sample(int i) { return sample_[static_cast<size_t>(i)]; }
  // The estimated bias of the sample's gathered light.
  const Spectrum& bias(int i) const { return bias_[static_cast<size_t>(i)]; }
  // Adds what was gathered at a vertex to the sample.
  void addGathered(int index, const SubpathVertex& vertex, const PhotonSum& sum, double lightPaths, float radius);
  void clear();
  uint64_t rayCount() const { return walks_.rayCount + likelyRays_; }
  uint64_t shadowRayCount = 0;
  uint64_t photonCount = 0;  // that gathers found

 private:
  struct Step {
    Onward onward = Onward::End;
    bool gather = false;
  };
  // The lobes of a vertex by group; null: there are none.
  struct Lobes {
    const Bsdf *broad = nullptr, *narrow = nullptr;
    float broadShare = 0;
  };
  struct Path {
    // Probability of the group by which the path goes on from the vertex under way, and went on from the last one.
    float choiceHere = 1, choice = 1;
    bool seekingLight = false;  // ends at the next surface
    bool featuresDone = false;
    // Squared, per probability of going on: CausticMerging's density at the vertex under way, and at the one from which
    // nothing but delta scattering has been met. 0: nothing is merged there.
    double mergedHere2 = 0, merged2 = 0;

    void arrive(const SubpathState& state) {
      // A pane that was passed was no vertex.
      if (!state.throughPane) {
        choice = choiceHere;
        if (state.deltaSurfaces() == 0) merged2 = mergedHere2;
      }
      choiceHere = 1;
      mergedHere2 = 0;
    }
  };

  Step shade(int index, SubpathState& state, SubpathVertex& vertex);
  void mergeCaustics(int index, const SubpathVertex& vertex, const Bsdf& narrow, float choice);
  float causticHitWeight(int index, const SubpathState& state, uint32_t light, const Vec3& direction,
                         float cosLight) const;
  void addEnvironment(int index, const SubpathState& state);
  void addEmission(int index, const SubpathState& state, const SubpathVertex& vertex);
  void addUnlit(int index, const SubpathState& state, const SubpathVertex& vertex);
  void sampleLight(int index, const SubpathVertex& vertex, const Lobes& lobes, const SampleBlock& block,
                   bool forFeatures);
  void traceShadows();

  const TransportContext& context_;
  const Scene& scene_;
  const Plan& plan_;
  const PassSampler& sampler_;
  const MediaStack& cameraMedia_;
  const CausticMerging* caustics_;
  const float time_;  // of all paths
  bool lightsCanBeHit_;
  SubpathBatch walks_;
  int count_ = 0;
  std::array<Path, kBatch> path_;
  std::array<PathSample, kBatch> sample_;
  std::array<Spectrum, kBatch> bias_;
  std::array<CameraStart, kBatch> start_;
  LikelyFeatures likely_;
  uint64_t likelyRays_ = 0;

  struct Shadow {
    int index;
    Spectrum contribution;
    bool forFeatures;
  };
  VisibilityBatch shadowRays_;
  std::array<Shadow, kBatch> shadow_;
  int shadowCount_ = 0;
};

}  // namespace braid
