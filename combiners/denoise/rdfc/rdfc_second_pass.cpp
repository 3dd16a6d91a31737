// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/rdfc/rdfc_second_pass.h"

#include "combiners/denoise/rdfc/rdfc_features.h"
#include "combiners/denoise/rdfc/rdfc_window.h"

namespace braid {

std::vector<Rgb<float>> rdfcSecondPass(const std::vector<const Rgb<float>*>& images, const Rgb<float>& mean,
                                       const std::vector<RdfcGuide>& features, uint64_t passes,
                                       const RdfcSecondPass& settings, const std::atomic<bool>* cancel) {
  const Rgb<float>&a = *images[images.size() - 2], &b = *images.back();
  RdfcGuide guide;
  std::vector<MirroredPlane> targets;
  for (size_t c = 0; c < 3; ++c)
    guide.push_back({MirroredPlane(mean[c]), MirroredPlane(rdfcHalvesVariance(a[c], b[c], passes)), {}});
  for (const Rgb<float>* image : images)
    for (size_t c = 0; c < 3; ++c) targets.emplace_back((*image)[c]);
  RdfcWindowFilter filter;
  filter.guide = &guide;
  filter.k = settings.k;
  filter.window = settings.window;
  filter.spread = rdfc::Spread::Own;
  filter.features = features.empty() ? nullptr : &features;
  std::vector<Plane<float>> filtered = rdfcFiltered(filter, targets, cancel);
  std::vector<Rgb<float>> out(images.size());
  for (size_t p = 0; p < filtered.size(); ++p) out[p / 3][p % 3] = std::move(filtered[p]);
  return out;
}

}  // namespace braid
