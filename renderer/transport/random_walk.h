// SPDX-License-Identifier: Apache-2.0
// Media that scatter (KHR_materials_volume_scatter): what light does between the boundaries of a solid. A walk goes
// from one surface point to the next, turning at events in between, which are no vertices: nothing is connected to
// them, and no light is sampled there (integrators/README.md, Walks through media).
//
// Distances are those to the next event in one channel, drawn in proportion to what the path carries; the weight is
// that of the balance heuristic over the three channels, which keeps the sum of a path's channels from growing.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/core/sampler.h"
#include "renderer/transport/bsdf/warp.h"
#include "renderer/transport/media.h"

namespace braid {

// --- Phase function: Henyey and Greenstein 1941, "Diffuse radiation in the Galaxy", equation 2 ---

// Density per steradian of turning by an angle with this cosine; g > 0 goes on, g < 0 goes back.
inline float henyeyGreensteinPdfW(float cosine, float g) {
  const float a = std::fabs(g), less = 1 - (g < 0 ? -cosine : cosine);
  const float d = sqr(1 - a) + 2 * a * less;
  return kInvFourPi * (1 - a) * (1 + a) / (d * std::sqrt(d));
}

// A direction to go on in for one that arrives along the unit vector `direction`. The distribution of the cosine is
// inverted for 1 - cosine, which cancels nowhere.
inline Vec3 sampleHenyeyGreenstein(const Vec3& direction, float g, const Vec2& u) {
  const float a = std::fabs(g);
  const float less = 2 * (1 - u.x) * (1 + a * u.x) * sqr((1 - a) / (1 - a + 2 * a * u.x));
  const float sine = safeSqrt(less * (2 - less));
  const SinCos t = sinCosTurn(u.y);
  const float cosine = g < 0 ? less - 1 : 1 - less;
  return renormalize(Frame(direction).toWorld(Vec3(sine * t.cos, sine * t.sin, cosine)));
}

// --- Free flight through a medium of an extinction per metre and channel ---

// Probabilities of the channels for a path of this throughput.
inline Spectrum flightChannels(const Spectrum& throughput) {
  const float sum = throughput.x + throughput.y + throughput.z;
  return sum > 0 && std::isfinite(sum) ? throughput / sum : Spectrum(1.0f / 3);
}

// Metres to the next event; infinite where the channel that `select` picks meets none.
inline float sampleFlight(const Spectrum& extinction, const Spectrum& channels, float select, float u) {
  const float sigma = select < channels.x                ? extinction.x
                      : select < channels.x + channels.y ? extinction.y
                                                         : extinction.z;
  return sigma > 0 ? -std::log1p(-u) / sigma : kInfinity;
}

// `value` over its mean by the probabilities of the channels.
inline Spectrum overChannels(const Spectrum& value, const Spectrum& channels) {
  const float density = glm::dot(value, channels);
  return density > 0 ? value / density : Spectrum(0);
}

inline bool isGrey(const Spectrum& s) { return s.x == s.y && s.y == s.z; }

// Weight of a flight that was to go further than `distance`: transmittance over its probability.
inline Spectrum passageWeight(const Spectrum& extinction, const Spectrum& channels, float distance) {
  if (isGrey(extinction)) return Spectrum(1);
  return overChannels(transmittanceAfter(extinction, distance), channels);
}

// Weight of one that has ended at an event after `distance`, without the event's albedo.
inline Spectrum collisionWeight(const Spectrum& extinction, const Spectrum& channels, float distance) {
  if (isGrey(extinction)) return Spectrum(1);
  return overChannels(extinction * transmittanceAfter(extinction, distance), channels);
}

// --- Walks ---

// Of a path, since the last surface or pane.
struct WalkState {
  const Material* medium = nullptr;  // that the ray under way runs through, if it scatters
  float flight = 0;                  // metres after which the ray meets an event, unless a surface comes first
  float start = 0;                   // greatest channel of the throughput with which the walk began
  int rays = 0;                      // that the walk has sent
  unsigned block = 0;                // of the path's random numbers
};

// How a ray through a medium has ended. Left: where there is nothing more, beyond the bounds of the scene; the solid is
// not closed.
enum class Flight : uint8_t { Surface, Scattered, Left, Absorbed };

// Carries paths through media, out of line: in line, it would make the kernels of scenes without media slower. Any
// state that has a throughput, an origin, a direction, media, a walk, a key and a block().
class RandomWalk {
 public:
  // Walks that lose little would be long: beyond so many rays the chance of still going on falls as the root of their
  // number. In half a space that absorbs nothing, the share of walks with more than n events falls likewise, so that
  // their number is bounded on average while the variance grows by its logarithm alone.
  static constexpr int kLong = 1024;
  static constexpr int kMostRays = 1 << 20;
  static constexpr float kRouletteLevel = 0.2f;  // of what a walk began with

  RandomWalk(const Scene& scene, const PassSampler& sampler)
      : scene_(scene), sampler_(sampler), any_(scene.traits().has(kTraitScattering)) {
    if (!scene.bounds().empty())
      nearby_ =
          0x1p-18f * std::max(maxComponent(magnitudes(scene.bounds().lo)), maxComponent(magnitudes(scene.bounds().hi)));
  }

  // Whether the scene has media that scatter.
  bool any() const { return any_; }

  // How far the ray that a path is about to send need look for surfaces: a little further than to the next event.
  template <class State>
  [[gnu::noinline]] float begin(State& path) const {
    WalkState& walk = path.walk;
    if (walk.block != path.block()) walk = {.start = maxComponent(path.throughput), .block = path.block()};
    walk.medium = nullptr;
    if (path.media.empty()) return kInfinity;
    const int64_t ruling = path.media.ruling(scene_.materials());
    if (ruling < 0 || isBlack(scene_.materials()[static_cast<size_t>(ruling)].extinction)) return kInfinity;
    walk.medium = &scene_.materials()[static_cast<size_t>(ruling)];
    ++walk.rays;
    const uint32_t seed = seedOf(path);
    walk.flight =
        sampleFlight(walk.medium->extinction, flightChannels(path.throughput), number(seed, 0), number(seed, 1));
    return walk.flight + nearby_;
  }

  // Takes the path to the end of that ray; `hit` is null where it met nothing. Scattered: the next ray may begin.
  template <class State>
  [[gnu::noinline]] Flight finish(State& path, const Hit* hit) const {
    const WalkState& walk = path.walk;
    const Spectrum &extinction = walk.medium->extinction, channels = flightChannels(path.throughput);
    if (hit && hit->distance <= walk.flight) {
      path.throughput *= passageWeight(extinction, channels, hit->distance);
      return Flight::Surface;
    }
    Vec3 place = path.origin + walk.flight * path.direction;
    if (!hit && !contains(scene_.bounds(), place)) {
      path.throughput *= passageWeight(extinction, channels, distanceWithin(path.origin, path.direction));
      return Flight::Left;
    }
    if (hit) keepInside(*hit, place);
    path.throughput *= walk.medium->scatterAlbedo * collisionWeight(extinction, channels, walk.flight);
    const uint32_t seed = seedOf(path);
    const float survival = survivalOf(walk, maxComponent(path.throughput));
    if (!(number(seed, 4) < survival)) return Flight::Absorbed;
    path.throughput /= survival;
    path.origin = place;
    path.direction =
        sampleHenyeyGreenstein(path.direction, walk.medium->scatterAnisotropy, {number(seed, 2), number(seed, 3)});
    return Flight::Scattered;
  }

  // Probability with which a walk goes on that carries `carried` in its greatest channel.
  static float survivalOf(const WalkState& walk, float carried) {
    if (walk.rays >= kMostRays) return 0;
    const float survival = std::min(1.0f, carried / (kRouletteLevel * walk.start));
    const auto n = static_cast<float>(walk.rays);
    return walk.rays > kLong ? survival * std::sqrt((n - 1) / n) : survival;
  }

 private:
  // A walk has random numbers of its own, by the ray and the block of the path.
  template <class State>
  uint32_t seedOf(const State& path) const {
    return sampler_.salt(path.key, 0x80000000u + (path.walk.block << 20) + static_cast<uint32_t>(path.walk.rays));
  }
  static float number(uint32_t seed, uint32_t i) {
    return static_cast<float>(mix32(seed + i * 0x9e3779b9u) >> 8) * 0x1p-24f;
  }

  static bool contains(const Bounds& b, const Vec3& p) {
    return p.x >= b.lo.x && p.x <= b.hi.x && p.y >= b.lo.y && p.y <= b.hi.y && p.z >= b.lo.z && p.z <= b.hi.z;
  }
  // Metres to where a ray leaves the bounds of the scene; 0 from outside.
  float distanceWithin(const Vec3& origin, const Vec3& direction) const {
    const Bounds& b = scene_.bounds();
    float distance = kInfinity;
    for (int c = 0; c < 3; ++c)
      if (direction[c] != 0)
        distance = std::min(distance, ((direction[c] > 0 ? b.hi[c] : b.lo[c]) - origin[c]) / direction[c]);
    return std::max(distance, 0.0f);
  }
  // An event that rounding could put onto the surface ahead, or beyond, moves as far off it as a ray would start.
  static void keepInside(const Hit& hit, Vec3& place) {
    const float reach = glm::dot(offsetOrigin(hit, hit.ng) - hit.position, hit.ng);
    const float height = glm::dot(place - hit.position, hit.ng);
    if (height < reach) place += (reach - height) * hit.ng;
  }

  const Scene& scene_;
  const PassSampler& sampler_;
  const bool any_;
  float nearby_ = 0;  // metres within which rounding may move an event across a surface
};

}  // namespace braid
