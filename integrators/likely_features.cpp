// SPDX-License-Identifier: Apache-2.0
#include "integrators/likely_features.h"

#include <array>

namespace braid {

namespace {

constexpr float kLikely = 0.5f;  // of two lobes, the other one is less

WalkSettings likelyWalk(const Plan& plan) {
  WalkSettings settings;
  settings.maxSegments = plan.settings.maxDepth;
  settings.roulette = {Roulette::kNever, 1};
  settings.mis = false;
  settings.likelyLobes = true;
  return settings;
}

}  // namespace

const MediaStack& LikelyFeatures::mediaAt(float time) {
  if (!media_ || context_.scene.moves()) media_ = mediaOfCamera(context_.scene, plan_.camera, time);
  return *media_;
}

void LikelyFeatures::add(const CameraStart& from, PathSample& sample) {
  if (!plan_.kept.features || sample.leastLobe >= kLikely) return;
  if (!walks_) walks_ = std::make_unique<SubpathBatch>(context_, sampler_, likelyWalk(plan_));
  const Camera::CameraRay ray = cameraRayThrough(plan_, sampler_.block(from.key, 0), from.x, from.y, from.time);
  walks_->startCamera(from.key, ray, mediaAt(from.time), 1, 1, plan_.camera.orthographic());
  samples_.push_back(&sample);
}

Onward LikelyFeatures::shade(PathSample& likely, const SubpathVertex& vertex) const {
  if (context_.summaryOf(vertex.hit).unlit) {
    unlitColor(context_.scene, vertex, true, likely);
    return Onward::End;
  }
  return recordFeatures(context_.scene, vertex, plan_.settings.maxDepth, likely) ? Onward::End : Onward::Scatter;
}

uint64_t LikelyFeatures::run() {
  if (samples_.empty()) return 0;
  std::array<PathSample, kBatch> likely;
  walks_->run([&](int index, const SubpathState&,
                  const SubpathVertex& vertex) { return shade(likely[static_cast<size_t>(index)], vertex); },
              [&](int index, const SubpathState& state) {
                radianceBeyond(context_.scene, plan_, state.direction, state.fromCamera(), true, 1,
                               likely[static_cast<size_t>(index)]);
              });
  for (size_t i = 0; i < samples_.size(); ++i) {
    likely[i].features.visibility = samples_[i]->features.visibility;
    samples_[i]->features = likely[i].features;
  }
  samples_.clear();
  walks_->clear();
  const uint64_t rays = walks_->rayCount;
  walks_->rayCount = 0;
  return rays;
}

}  // namespace braid
