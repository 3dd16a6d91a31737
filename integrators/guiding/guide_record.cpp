// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/guide_record.h"

namespace braid {

void PathRecorder::leave(int i, const Hit& hit, const GuidedBsdf& bsdf, const GuidedSample& sample) {
  Vertices& path = vertices_[static_cast<size_t>(i)];
  if (path.count == kMostVertices) return;
  GuideRecord& record = path.record[path.count++];
  const int surface = guideClass(hit.ng, GuidedBsdf::isNarrow(bsdf.bsdf()));
  record.position = hit.position;
  record.pdfW = sample.pdfW;
  record.bsdfPdfW = sample.bsdfPdfW;
  record.guidePdfW = sample.guidePdfW;
  record.guided = bsdf.guided() ? 1u : 0u;
  record.surface = static_cast<uint32_t>(surface) & 0xfu;
  path.travels = true;
}

void PathRecorder::finish(int i, const Spectrum& radiance, uint32_t pixel, std::vector<GuideRecord>& out) const {
  const Vertices& path = vertices_[static_cast<size_t>(i)];
  const size_t arrived = path.count - (path.travels ? 1 : 0);  // a path that roulette ended has not
  for (size_t k = 0; k < arrived; ++k) {
    const float value = average(radiance) - path.before[k];
    if (!(value > 0) || !std::isfinite(value)) continue;
    GuideRecord& record = out.emplace_back(path.record[k]);
    record.value = value;
    record.pixel = pixel & 0x7ffffffu;
  }
}

}  // namespace braid
