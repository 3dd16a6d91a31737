// SPDX-License-Identifier: Apache-2.0
// Variants of a render against each other: error times processor seconds, in one run, interleaved. The product does
// not depend on how many samples are taken where errors fall as their number rises, nor on the number of threads.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "renderer/scene/scene.h"
#include "tools/options/combining.h"
#include "tools/options/scene_options.h"

namespace braid {

struct RenderVariant {
  std::string text;  // its options
  SampleChoice samples;
  CombineChoice combine;  // none unless it is named
};

// What `text` holds, options of `braid render` about samples and combining, over those in `base`. Throws Error(Usage)
// naming the variant.
RenderVariant parseVariant(const std::string& text, const SampleChoice& base);

struct EfficiencyBench {
  std::vector<RenderVariant> variants;
  SceneChoice view;  // the size
  int repeats = 3;   // seeds
  // References are kept here, rendered by this integrator with so many samples where they are missing.
  std::string references, referenceIntegrator;
  uint64_t referenceSpp = 1024;
};

// For each variant, as medians over the seeds: relative squared error with the reference's noise taken out, HDR-FLIP,
// processor and wall-clock seconds with planning, preparing and combining; and its error · processor seconds over that
// of the first variant with the same seed.
nlohmann::json benchEfficiency(const Scene& scene, const CameraData& camera, const EfficiencyBench& bench);

}  // namespace braid
