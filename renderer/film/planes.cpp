// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/planes.h"

#include <utility>

#include "renderer/core/error.h"

namespace braid {

namespace {

constexpr std::array kEstimatePlanes = {
    EstimatePlane{"mean", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.mean; }},
    EstimatePlane{"halfA", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.half[0]; }},
    EstimatePlane{"halfB", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.half[1]; }},
    EstimatePlane{"variance", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.variance; }},
    EstimatePlane{"bias", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.bias; }},
    EstimatePlane{"biasA", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.biasHalf[0]; }},
    EstimatePlane{"biasB", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.biasHalf[1]; }},
    EstimatePlane{"biasVariance", PlaneSet::Always, [](Estimate& e) -> Rgb<float>& { return e.biasVariance; }},
    EstimatePlane{"direct", PlaneSet::Direct, [](Estimate& e) -> Rgb<float>& { return e.direct.mean; }},
    EstimatePlane{"directA", PlaneSet::Direct, [](Estimate& e) -> Rgb<float>& { return e.direct.half[0]; }},
    EstimatePlane{"directB", PlaneSet::Direct, [](Estimate& e) -> Rgb<float>& { return e.direct.half[1]; }},
    EstimatePlane{"directVariance", PlaneSet::Direct, [](Estimate& e) -> Rgb<float>& { return e.direct.variance; }},
    EstimatePlane{"indirectVariance", PlaneSet::Direct, [](Estimate& e) -> Rgb<float>& { return e.indirectVariance; }},
};

constexpr std::array kHistoryPlanes = {
    HistoryPlane{"variance", [](Checkpoint& c) -> Rgb<float>& { return c.variance; }},
    HistoryPlane{"mean", [](Checkpoint& c) -> Rgb<float>& { return c.mean; }},
    HistoryPlane{"halfA", [](Checkpoint& c) -> Rgb<float>& { return c.half[0]; }},
    HistoryPlane{"halfB", [](Checkpoint& c) -> Rgb<float>& { return c.half[1]; }},
};

template <class P>
P& partOf(FeaturePlanes<P>& f, size_t part) {
  return part == 0 ? f.mean : part == 3 ? f.variance : f.half[part - 1];
}

Plane<float>& componentOf(Plane<float>& plane, size_t) { return plane; }
Plane<float>& componentOf(Rgb<float>& planes, size_t c) { return planes[c]; }

}  // namespace

std::span<const EstimatePlane> estimatePlanes() { return kEstimatePlanes; }

std::string quarterName(size_t quarter) { return "q" + std::to_string(quarter); }

std::span<const HistoryPlane> historyPlanes() { return kHistoryPlanes; }

Plane<float>& featurePlane(Features& features, size_t feature, size_t part, size_t c) {
  BRAID_ASSERT(feature < kFeaturePlanes.size() && part < kFeatureParts.size());
  Plane<float>* found = nullptr;
  size_t index = 0;
  forEachFeature(features, [&](auto& planes) {
    if (index++ == feature) found = &componentOf(partOf(planes, part), c);
  });
  return *found;
}

const Plane<float>& featurePlane(const Features& features, size_t feature, size_t part, size_t c) {
  return featurePlane(const_cast<Features&>(features), feature, part, c);
}

}  // namespace braid
