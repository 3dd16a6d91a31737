// SPDX-License-Identifier: Apache-2.0
#include "combiners/auto/auto_filters.h"

#include <array>

#include "combiners/denoise/pw/pw1_filter.h"
#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/statistics/direct_indirect.h"
#include "combiners/statistics/fireflies.h"

namespace braid {

namespace {

constexpr uint64_t kFirstOrderPasses = 64;  // fewer: slopes fit noise

// The careful filter is for what the wide one takes for noise, which is small (combiners/EXPERIMENTS.md, Careful
// filter).
constexpr PatchWelchNeighbours kCarefulNeighbours{4};
constexpr int kFirstOrderStride = 7;  // with a careful filter beside it, fits every fifth pixel change no error either

Estimate asEstimate(std::vector<Rgb<float>> images, const char* name) {
  Estimate e;
  e.name = name;
  e.mean = std::move(images[0]);
  for (size_t h = 0; h + 1 < images.size(); ++h) e.half[h] = std::move(images[1 + h]);
  return e;
}

// The wide filter, or its first-order fit. None once cancelled.
std::vector<Estimate> wideFilter(const PatchWelchInput& input, bool firstOrder, const std::atomic<bool>* cancel) {
  FirstOrderOptions fits;
  fits.stride = kFirstOrderStride;
  auto wide = firstOrder ? patchWelchFirstOrder(input, fits, cancel)
                         : std::move(patchWelch(input, std::array{kPatchWelchWideThreshold}, {}, {}, cancel)[0]);
  if (cancel && cancel->load()) return {};
  return {asEstimate(std::move(wide), firstOrder ? "pw1" : "pw-wide")};
}

}  // namespace

std::vector<Estimate> autoFilters(const Estimate& x, const Features* features, const std::atomic<bool>* cancel) {
  const auto cancelled = [&] { return cancel && cancel->load(); };
  std::vector<Estimate> filtered;
  if (cancelled()) return filtered;
  {
    const PatchWelchInput input = patchWelchInput(x, features);
    if (input.variance.empty()) return filtered;
    filtered = wideFilter(input, x.passes >= kFirstOrderPasses, cancel);
  }
  if (cancelled()) return filtered;
  const PatchWelchInput robust = patchWelchInput(x, features, true);
  auto careful = patchWelch(robust, std::array{kPatchWelchThreshold}, kCarefulNeighbours, {}, cancel);
  filtered.push_back(asEstimate(std::move(careful[0]), "pw-robust"));
  return filtered;
}

std::vector<Estimate> autoFiltersOfParts(const Estimate& x, bool removeFireflies, const Features* features,
                                         const std::atomic<bool>* cancel) {
  std::vector<Estimate> sums;
  for (Estimate (*part)(const Estimate&) : {directLight, indirectLight}) {
    Estimate light = part(x);
    if (removeFireflies) {
      const std::vector<Firefly> fireflies = findFireflies(light, {}, features);
      for (Rgb<float>* image : {&light.mean, &light.half[0], &light.half[1]}) replaceValues(*image, fireflies);
      replaceVariances(light.variance, fireflies);
    }
    std::vector<Estimate> filtered = autoFilters(light, features, cancel);
    for (size_t i = 0; i < sums.size() && i < filtered.size(); ++i) addImage(sums[i], filtered[i]);
    if (sums.empty()) sums = std::move(filtered);
  }
  return sums;
}

}  // namespace braid
