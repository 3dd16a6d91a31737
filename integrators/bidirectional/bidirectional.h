// SPDX-License-Identifier: Apache-2.0
// Bidirectional path tracing of a batch of pixels (Veach 1997, chapter 10): one light subpath and one eye subpath per
// pixel, joined in every way. With s vertices from the light and t from the camera (itself included):
//   s = 0           the eye subpath hits a light,
//   s = 1           next-event estimation, with a light point of its own,
//   s > 1, t > 1    a connection of two stored vertices,
//   t = 1           a light vertex is connected to the camera and splatted.
// Light subpaths are not tested for hitting the lens (t = 0), and lights are seen directly by s = 0 alone. Weights:
// power heuristic through the recursive quantities of renderer/transport/subpath.h, whose report's numbers appear
// below.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "integrators/bidirectional/merge_grid.h"
#include "integrators/likely_features.h"
#include "integrators/path_kernel.h"
#include "renderer/transport/subpath.h"

namespace braid {

// Hears of every weighted contribution that turned out visible; for the images of single strategies and for replays.
struct StrategyObserver {
  virtual ~StrategyObserver() = default;
  // (x, y) in the full frame.
  virtual void onContribution(int s, int t, int x, int y, const Spectrum& value) = 0;
  virtual void onVertex(const SubpathVertex&, Transport) {}
};

// What light subpaths of a pass have in common.
struct LightPaths {
  const LightEmission& emission;
  const PassSampler& sampler;
  double count;  // of the pass

  // Starts the subpath of an item on the batch.
  void start(SubpathBatch& batch, uint64_t item, float time) const;
};

// Merging of eye vertices with the light vertices of a pass (vertex connection and merging).
struct Merging {
  const MergeGrid* grid = nullptr;
  double connectWeight = 0, mergeWeight = 0;  // WalkSettings
  float normalization = 0;                    // 1 / (π r² · light subpaths)
};

// What the kernels of a pass share. Merging may be null.
struct BidirectionalPass {
  const LightPaths& lights;
  const PassSampler& eyeSampler;
  const MediaStack& cameraMedia;
  const Merging* merging = nullptr;
  std::optional<float> time = std::nullopt;  // of all paths; none: each pixel has its own
};

// The walks of a plan's subpaths; merging may be null.
WalkSettings bidirectionalWalk(const Plan& plan, Transport transport, const Merging* merging);

// Follows connections that may be blocked, up to a batch at a time, and hands out what is visible.
class ConnectionQueue {
 public:
  struct Entry {
    Spectrum value;
    int s, t;
    int sample;  // index of the eye subpath, or -1: a splat at (x, y)
    int x = 0, y = 0;
    bool forFeatures = false;
  };
  using Deliver = std::function<void(const Entry&)>;
  ConnectionQueue(const TransportContext& context, Deliver deliver) : deliver_(std::move(deliver)), rays_(context) {}

  // `index`: of refraction, between the two ends.
  void add(const RayQuery& ray, float index, const Entry& entry) {
    rays_.set(count_, ray, index);
    entries_[static_cast<size_t>(count_)] = entry;
    if (++count_ == kBatch) flush();
  }
  void flush();
  uint64_t rayCount = 0;

 private:
  Deliver deliver_;
  VisibilityBatch rays_;
  std::array<Entry, kBatch> entries_;
  int count_ = 0;
};

class BidirectionalKernel {
 public:
  BidirectionalKernel(const PassRequest& request, const BidirectionalPass& pass, PassTarget& target,
                      StrategyObserver* observer = nullptr);

  // Renders up to kBatch pixels (full-frame coordinates) and stores their samples; splats go anywhere.
  void render(const std::vector<std::pair<int, int>>& pixels);

  uint64_t rayCount() const { return light_.rayCount + eye_.rayCount + likelyRays_; }
  uint64_t shadowRayCount() const { return queue_.rayCount; }

 private:
  Onward storeLightVertex(int index, const SubpathVertex& vertex);
  void connectToCamera(const SubpathVertex& vertex);
  void startEye(int x, int y, float time);
  Onward shadeEyeVertex(int index, const SubpathState& state, const SubpathVertex& vertex);
  void addEmission(int index, const SubpathState& state, const SubpathVertex& vertex);
  void addEnvironment(int index, const SubpathState& state);
  void addUnlit(int index, const SubpathState& state, const SubpathVertex& vertex);
  void sampleLight(int index, const SubpathVertex& vertex, bool forFeatures);
  void connect(int index, const SubpathVertex& eye);
  void merge(int index, const SubpathVertex& eye);
  void deliver(const ConnectionQueue::Entry& entry);
  void add(int index, int s, int t, const Spectrum& value);

  const PassRequest& request_;
  const TransportContext& context_;
  const Scene& scene_;
  const Plan& plan_;
  const LightPaths& lights_;
  const PassSampler& eyeSampler_;
  MediaStack cameraMedia_;
  PassTarget& target_;
  StrategyObserver* observer_;
  const Merging* merging_;
  const std::optional<float> time_;
  double mergeWeight_;  // 0 without merging
  SubpathBatch light_, eye_;
  LikelyFeatures likely_;
  uint64_t likelyRays_ = 0;
  ConnectionQueue queue_;
  const std::vector<std::pair<int, int>>* pixels_ = nullptr;
  std::array<std::vector<SubpathVertex>, kBatch> stored_;  // light vertices that connections may use
  std::array<PathSample, kBatch> sample_;
  std::array<bool, kBatch> featuresDone_;
  std::array<float, kBatch> pathTime_;
  std::array<float, kBatch> candidates_;  // unoccluded contributions of connections so far

  struct Candidate {
    size_t vertex;
    Spectrum value;
    float size;
    Vec3 direction;
    float index;  // of refraction, between
  };
  std::vector<Candidate> candidate_;
};

// Renders the pixels of a tile in batches.
void renderTile(BidirectionalKernel& kernel, const PixelWindow& tile);

}  // namespace braid
