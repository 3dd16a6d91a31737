// SPDX-License-Identifier: Apache-2.0
#include "combiners/second_pass.h"

#include "combiners/denoise/rdfc_features.h"
#include "combiners/denoise/rdfc_window.h"

namespace braid {

namespace {

// RDFC takes 0.45 for images that have kept more of their noise.
constexpr float kSensitivity = 0.85f;
constexpr int kWindow = 4;

}  // namespace

Estimate secondPass(const Estimate& image, const Features* features, uint64_t passes, const std::atomic<bool>* cancel) {
  RdfcGuide colour;
  std::vector<MirroredPlane> targets;
  for (size_t c = 0; c < 3; ++c)
    colour.push_back({MirroredPlane(image.mean[c]),
                      MirroredPlane(rdfcHalvesVariance(image.half[0][c], image.half[1][c], passes)),
                      {}});
  for (const Rgb<float>* part : {&image.mean, &image.half[0], &image.half[1]})
    for (size_t c = 0; c < 3; ++c) targets.emplace_back((*part)[c]);
  const std::vector<RdfcGuide> guides = features ? rdfcRawFeatures(*features) : std::vector<RdfcGuide>();
  RdfcWindowFilter filter;
  filter.guide = &colour;
  filter.k = kSensitivity;
  filter.window = kWindow;
  filter.spread = rdfc::Spread::Own;
  if (!guides.empty()) filter.features = &guides;
  std::vector<Plane<float>> filtered = rdfcFiltered(filter, targets, cancel);
  Estimate out;
  for (size_t c = 0; c < 3; ++c) {
    out.mean[c] = std::move(filtered[c]);
    for (size_t h = 0; h < 2; ++h) out.half[h][c] = std::move(filtered[3 * (1 + h) + c]);
  }
  return out;
}

}  // namespace braid
