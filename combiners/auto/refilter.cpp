// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/refilter.h"

#include "combiners/denoise/rdfc/rdfc_features.h"
#include "combiners/denoise/rdfc/rdfc_second_pass.h"

namespace braid {

namespace {

// RDFC's own images have kept more of their noise.
constexpr RdfcSecondPass kSettings{0.85f, 4};

}  // namespace

Estimate refilter(const Estimate& image, const Features* features, uint64_t passes, const std::atomic<bool>* cancel) {
  const std::vector<RdfcGuide> guides = features ? rdfcRawFeatures(*features) : std::vector<RdfcGuide>();
  std::vector<Rgb<float>> filtered =
      rdfcSecondPass({&image.mean, &image.half[0], &image.half[1]}, image.mean, guides, passes, kSettings, cancel);
  Estimate out;
  out.mean = std::move(filtered[0]);
  for (size_t h = 0; h < 2; ++h) out.half[h] = std::move(filtered[1 + h]);
  return out;
}

}  // namespace braid
