// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/shrunk_filters.h"

#include "combiners/shrinkage/shrinkage.h"
#include "combiners/statistics/half_statistics.h"

namespace braid {

std::vector<Estimate> shrunkTowards(const std::vector<Estimate>& filters, const Estimate& x,
                                    const std::atomic<bool>* cancel) {
  JamesSteinSettings settings;
  settings.constant = 1;
  settings.gate = true;
  settings.shared = true;
  settings.filter = VarianceFilter::Whitened;
  settings.keepFactors = false;
  std::vector<Estimate> out(filters.size());
  for (size_t b = 0; b < filters.size(); ++b) out[b].name = "js@" + filters[b].name;
  const auto shrink = [&](const Rgb<float>& image, const Rgb<float>& noise, const auto& partOf) {
    const NoiseScale scale = noiseScale(noise, settings);
    for (size_t b = 0; b < filters.size() && !(cancel && cancel->load()); ++b)
      partOf(out[b]) = jamesStein(image, noise, scale, partOf(filters[b]), settings).image;
  };
  shrink(
      x.mean, x.variance, [](auto& e) -> auto& { return e.mean; });
  for (size_t h = 0; h < 2; ++h)
    shrink(
        x.half[h], halfVariance(x, x.variance, static_cast<int>(h)), [h](auto& e) -> auto& { return e.half[h]; });
  return out;
}

}  // namespace braid
