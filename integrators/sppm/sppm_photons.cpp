// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm/sppm_photons.h"

#include <atomic>
#include <cmath>
#include <utility>

#include "renderer/core/parallel.h"

namespace braid {

namespace {

constexpr uint64_t kChunk = 16 * kBatch;
constexpr uint64_t kFewestPaths = 1024;
// A surface that light only grazes gives photons of unbounded weight under interpolated normals.
constexpr float kGrazing = 0.01f;

bool makePhoton(const SubpathVertex& vertex, float keep, Photon& photon) {
  const Hit& hit = vertex.hit;
  const float cosine = glm::dot(hit.wo, hit.ng);
  if (!(cosine >= kGrazing)) return false;
  photon.position = hit.position;
  photon.power = vertex.throughput / (cosine * keep);
  photon.direction = packDirection(hit.wo, 16);
  photon.normal = static_cast<uint16_t>(packDirection(hit.ng, 8));
  photon.segments = static_cast<uint16_t>(std::min(vertex.segments, 65535));
  return isFinite(photon.power);
}

float hashToUnit(uint32_t h) { return static_cast<float>(h >> 8) * 0x1p-24f; }

template <class PhotonType>
void gatherChunks(std::vector<std::vector<PhotonType>>& chunks, std::vector<PhotonType>& out) {
  std::vector<size_t> offset(chunks.size() + 1, 0);
  for (size_t c = 0; c < chunks.size(); ++c) offset[c + 1] = offset[c] + chunks[c].size();
  out.resize(offset.back());
  parallelFor(chunks.size(), [&](size_t c) {
    std::copy(chunks[c].begin(), chunks[c].end(), out.begin() + static_cast<std::ptrdiff_t>(offset[c]));
    std::vector<PhotonType>().swap(chunks[c]);
  });
}

}  // namespace

bool depositsCaustic(const SubpathVertex& vertex) {
  return vertex.deltaOnly && (vertex.segments > 1 || vertex.walked) && !vertex.woBelow &&
         vertex.bsdf.broadShare() < 1 && vertex.bsdf.restricted(LobeGroup::Narrow).hasNonDelta();
}

uint64_t photonPaths(const Plan& plan) {
  if (plan.settings.photons > 0) return plan.settings.photons;
  return std::max(static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height()),
                  kFewestPaths);
}

bool tracePhotons(const TransportContext& context, const PhotonEmission& light, const Settings& settings, float keep,
                  const std::atomic<bool>* cancel, TracedPhotons& out) {
  const size_t chunks = static_cast<size_t>((light.paths + kChunk - 1) / kChunk);
  std::vector<std::vector<Photon>> photons(chunks);
  std::vector<std::vector<CausticPhoton>> caustics(chunks);
  std::atomic<uint64_t> segments{0};
  std::atomic<bool> cancelled{false};
  const int firstSegment = firstPhotonSegment(settings);
  const bool merges = mergesCaustics(context.scene, settings.maxDepth);
  parallelFor(chunks, [&](size_t c) {
    if (cancel && cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    const uint64_t begin = c * kChunk, end = std::min(light.paths, begin + kChunk);
    segments += followLightPaths(context, light, settings.maxDepth, begin, end,
                                 [&](uint64_t, const SubpathState& state, const SubpathVertex& v) {
                                   const bool broad = depositsPhoton(v, firstSegment),
                                              caustic = merges && depositsCaustic(v);
                                   if (!broad && !caustic) return Onward::Scatter;
                                   const auto draw = static_cast<uint32_t>(v.segments) | 0x40000000u;
                                   if (keep < 1 && hashToUnit(light.sampler.salt(state.key, draw)) >= keep)
                                     return Onward::Scatter;
                                   CausticPhoton photon;
                                   if (!makePhoton(v, keep, photon)) return Onward::Scatter;
                                   if (broad) photons[c].push_back(photon);
                                   if (!caustic) return Onward::Scatter;
                                   photon.hitDensity = static_cast<float>(std::sqrt(state.chain));
                                   caustics[c].push_back(photon);
                                   return Onward::Scatter;
                                 });
  });
  if (cancelled) return false;
  gatherChunks(photons, out.photons);
  gatherChunks(caustics, out.caustics);
  out.segments = segments;
  return true;
}

}  // namespace braid
