// SPDX-License-Identifier: Apache-2.0
// A small render of everything that a state holds, and comparison of its states.
#pragma once

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "tests/support/render_fixture.h"

namespace braid::test::state_renders {

// A box with a sphere of mirror-like metal: something for photons and splats, and rays that miss.
inline const Scene& scene() {
  static const Scene built = [] {
    SceneData data = cornellBox();
    TriangleMesh sphere;
    addSphere(sphere, Vec3(0, 0.6f, 0.4f), 0.4f, 2);
    Material metal = diffuseMaterial(Spectrum(0.9f));
    metal.metallic = 1;
    metal.roughness = 0.1f;
    data.materials.push_back(metal);
    addMesh(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1));
    return Scene(std::move(data));
  }();
  return built;
}

inline Settings everythingKept(const std::string& names, uint64_t spp) {
  Settings s = test::settingsFor(14, 11, spp);
  s.integrators = {names};
  if (names == "all") {
    s.integrators.clear();
    for (const Integrator* i : integrators()) s.integrators.push_back(i->name());
  }
  s.features = s.quarters = s.transparent = s.history = s.directIndirect = true;
  return s;
}

inline Session sessionFor(const Settings& settings) {
  return Session(scene(), makePlan(scene(), scene().data().cameras.at(0), settings, integrators()));
}

template <class T>
bool sameBits(const Plane<T>& a, const Plane<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data.data(), b.data.data(), a.size() * sizeof(T)) == 0);
}

template <class T>
bool sameBits(const Rgb<T>& a, const Rgb<T>& b) {
  return sameBits(a[0], b[0]) && sameBits(a[1], b[1]) && sameBits(a[2], b[2]);
}

template <class T>
bool sameBits(const std::vector<T>& a, const std::vector<T>& b) {
  bool same = a.size() == b.size();
  for (size_t i = 0; same && i < a.size(); ++i) same = sameBits(a[i], b[i]);
  return same;
}

// Everything but the seconds.
inline void checkSame(const FilmState& a, const FilmState& b, bool history = true) {
  REQUIRE(a.estimates.size() == b.estimates.size());
  for (size_t i = 0; i < a.estimates.size(); ++i) {
    const EstimateState &x = a.estimates[i], &y = b.estimates[i];
    INFO(x.name);
    CHECK(x.name == y.name);
    CHECK(x.passes == y.passes);
    CHECK(sameBits(x.sums.sums(), y.sums.sums()));
    CHECK(sameBits(x.sums.sumOfSquares(), y.sums.sumOfSquares()));
    for (int h = 0; h < 2; ++h) CHECK(sameBits(x.sums.biasSum(h), y.sums.biasSum(h)));
    CHECK(sameBits(x.sums.biasSumOfSquares(), y.sums.biasSumOfSquares()));
    REQUIRE(x.parts.has_value() == y.parts.has_value());
    if (x.parts) {
      CHECK(sameBits(x.parts->direct().sums(), y.parts->direct().sums()));
      CHECK(sameBits(x.parts->direct().sumOfSquares(), y.parts->direct().sumOfSquares()));
      CHECK(sameBits(x.parts->indirectSumOfSquares(), y.parts->indirectSumOfSquares()));
    }
    CHECK(x.sums.rejected() == y.sums.rejected());
    CHECK(x.sums.clampedSplats() == y.sums.clampedSplats());
    for (int k = 0; k < a.buckets; ++k) CHECK(x.sums.passesInBucket(k) == y.sums.passesInBucket(k));
    if (!history) continue;
    REQUIRE(x.history.size() == y.history.size());
    for (size_t h = 0; h < x.history.size(); ++h) {
      CHECK(x.history[h].passes == y.history[h].passes);
      CHECK(sameBits(x.history[h].variance, y.history[h].variance));
    }
  }
  REQUIRE(a.features.has_value() == b.features.has_value());
  if (a.features) {
    for (int h = 0; h < 2; ++h) CHECK(sameBits(a.features->sums(h), b.features->sums(h)));
    CHECK(sameBits(a.features->sumsOfSquares(), b.features->sumsOfSquares()));
    CHECK(a.features->passes() == b.features->passes());
  }
  REQUIRE(a.coverage.has_value() == b.coverage.has_value());
  if (a.coverage) {
    CHECK(sameBits(a.coverage->sums(), b.coverage->sums()));
    CHECK(a.coverage->passes() == b.coverage->passes());
  }
}

inline FilmState stateOf(const Settings& settings) {
  Session session = sessionFor(settings);
  session.run();
  return session.state();
}

}  // namespace braid::test::state_renders
