// SPDX-License-Identifier: Apache-2.0
// Features of what is most likely seen in glass and mirrors. A path enters glass or is reflected from it by chance;
// features that follow it are as noisy as its light, and filters take their noise for detail.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "integrators/camera_paths.h"

namespace braid {

// What a camera path begins with: pixel (x, y) of the full frame, the key of its random numbers, a time.
struct CameraStart {
  int x = 0, y = 0;
  uint64_t key = 0;
  float time = 0;
};

class LikelyFeatures {
 public:
  LikelyFeatures(const TransportContext& context, const Plan& plan, const PassSampler& sampler)
      : context_(context), plan_(plan), sampler_(sampler) {}

  // Where the path of a sample took a less likely way before it had features, run() replaces them, but for visibility,
  // by those of the walk from the same ray that takes the likeliest lobe of every specular surface. Elsewhere, and
  // where the plan keeps no features, nothing is done. At most kBatch samples before a run(), which returns the number
  // of rays.
  void add(const CameraStart& from, PathSample& sample);
  uint64_t run();

 private:
  const MediaStack& mediaAt(float time);
  Onward shade(PathSample& likely, const SubpathVertex& vertex) const;

  const TransportContext& context_;
  const Plan& plan_;
  const PassSampler& sampler_;
  std::unique_ptr<SubpathBatch> walks_;  // made for the first that is to be followed
  std::optional<MediaStack> media_;      // that the camera is inside of
  std::vector<PathSample*> samples_;
};

}  // namespace braid
