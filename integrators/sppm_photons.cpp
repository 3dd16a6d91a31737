// SPDX-License-Identifier: Apache-2.0
#include "integrators/sppm_photons.h"

#include <atomic>
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

}  // namespace

uint64_t photonPaths(const Plan& plan) {
  if (plan.settings.photons > 0) return plan.settings.photons;
  return std::max(static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height()),
                  kFewestPaths);
}

bool tracePhotons(const TransportContext& context, const PhotonEmission& light, const Settings& settings, float keep,
                  const std::atomic<bool>* cancel, TracedPhotons& out) {
  const size_t chunks = static_cast<size_t>((light.paths + kChunk - 1) / kChunk);
  std::vector<std::vector<Photon>> chunk(chunks);
  std::vector<size_t> offset(chunks + 1, 0);
  std::atomic<uint64_t> segments{0};
  std::atomic<bool> cancelled{false};
  const int firstSegment = firstPhotonSegment(settings);
  parallelFor(chunks, [&](size_t c) {
    if (cancel && cancel->load(std::memory_order_relaxed)) {
      cancelled = true;
      return;
    }
    const uint64_t begin = c * kChunk, end = std::min(light.paths, begin + kChunk);
    segments += followLightPaths(context, light, settings.maxDepth, begin, end,
                                 [&](uint64_t, const SubpathState& state, const SubpathVertex& v) {
                                   Photon photon;
                                   if (!depositsPhoton(v, firstSegment)) return true;
                                   const auto draw = static_cast<uint32_t>(v.segments) | 0x40000000u;
                                   if (keep < 1 && hashToUnit(light.sampler.salt(state.key, draw)) >= keep) return true;
                                   if (makePhoton(v, keep, photon)) chunk[c].push_back(photon);
                                   return true;
                                 });
  });
  if (cancelled) return false;
  for (size_t c = 0; c < chunks; ++c) offset[c + 1] = offset[c] + chunk[c].size();
  out.photons.resize(offset.back());
  parallelFor(chunks, [&](size_t c) {
    std::copy(chunk[c].begin(), chunk[c].end(), out.photons.begin() + static_cast<std::ptrdiff_t>(offset[c]));
    std::vector<Photon>().swap(chunk[c]);
  });
  out.segments = segments;
  return true;
}

}  // namespace braid
