// SPDX-License-Identifier: Apache-2.0
// The photon grid finds what a search of all photons finds, once each, in an order that threads do not change.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "integrators/sppm/photon_grid.h"
#include "tests/support/statistics/chi_squared.h"

namespace braid::test_photon_grid {

using test::Rng;

namespace {

// A plane, a line, a dense knot at one point and stragglers, about a camera at the origin; `segments` numbers them.
std::vector<Photon> clusteredPhotons(size_t count, float extent) {
  Rng rng(5);
  std::vector<Photon> photons(count);
  for (size_t i = 0; i < count; ++i) {
    const float a = rng.next() * 2 - 1, b = rng.next() * 2 - 1, c = rng.next() * 2 - 1;
    Vec3& p = photons[i].position;
    switch (i % 4) {
      case 0:
        p = Vec3(a, -0.3f, b);
        break;
      case 1:
        p = Vec3(0.01f * a, 0.01f * b, c);
        break;
      case 2:
        p = Vec3(0.5f) + 1e-4f * Vec3(a, b, c);
        break;
      default:
        p = Vec3(a, b, c) * std::exp2(-12 * rng.next());
    }
    p *= extent;
    photons[i].segments = static_cast<uint16_t>(i);
    photons[i].power = Spectrum(a, b, c);
  }
  return photons;
}

std::vector<uint16_t> found(const PhotonGrid& grid, const Vec3& p, float radius) {
  std::vector<uint16_t> list;
  grid.query(p, radius, [&](const Photon& photon, float) { list.push_back(photon.segments); });
  return list;
}

RadiusScale scaleFor(float extent, bool perspective) {
  RadiusScale s;
  s.perspective = perspective;
  s.camera = perspective ? Vec3(0) : Vec3(0.2f, 3, -1) * extent;
  s.perMetre = perspective ? 0.02f : 0.02f * extent;
  s.smallest = 1e-7f * extent;
  s.largest = 0.1f * extent;
  return s;
}

}  // namespace

TEST_CASE("photon grid: queries find exactly the photons within the radius, each once") {
  for (const bool perspective : {true, false})
    for (const float extent : {1e-3f, 1.0f, 1e4f}) {
      const std::vector<Photon> photons = clusteredPhotons(20000, extent);
      const PhotonGrid grid(photons, scaleFor(extent, perspective));
      CHECK(grid.size() == photons.size());
      Rng rng(6);
      size_t total = 0;
      for (int q = 0; q < 200; ++q) {
        // About photons, and with radii from those that the grid is made for to several times that.
        const Vec3 p = photons[static_cast<size_t>(rng.next() * 19999.0f)].position * (1 + 0.01f * rng.next());
        const float travelled = glm::length(p - grid.scale().camera) * std::exp2(4 * rng.next() - 1);
        const float radius = grid.scale().radiusAt(p, travelled);
        std::vector<uint16_t> list = found(grid, p, radius), expected;
        for (const Photon& photon : photons) {
          const Vec3 d = photon.position - p;
          if (glm::dot(d, d) < sqr(radius)) expected.push_back(photon.segments);
        }
        std::sort(list.begin(), list.end());
        std::sort(expected.begin(), expected.end());
        CHECK(list == expected);
        total += list.size();
      }
      CAPTURE(extent);
      CHECK(total > 1000);
    }
}

TEST_CASE("photon grid: threads change neither what is found nor the order") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const std::vector<Photon> photons = clusteredPhotons(60000, 1);
  const RadiusScale scale = scaleFor(1, true);
  std::vector<std::vector<uint16_t>> lists;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    arena.execute([&] {
      const PhotonGrid grid(photons, scale);
      std::vector<uint16_t> all;
      for (size_t i = 0; i < photons.size(); i += 97) {
        const Vec3& p = photons[i].position;
        const std::vector<uint16_t> list = found(grid, p, scale.radiusAt(p, glm::length(p)));
        all.insert(all.end(), list.begin(), list.end());
      }
      lists.push_back(std::move(all));
    });
  }
  CHECK(lists[0].size() > 1000);
  CHECK(lists[0] == lists[1]);
  CHECK(lists[0] == lists[2]);
}

TEST_CASE("photon grid: empty, single and coinciding photons") {
  const RadiusScale scale = scaleFor(1, true);
  CHECK(found(PhotonGrid({}, scale), Vec3(0.5f), 0.1f).empty());
  std::vector<Photon> same(3000);
  for (size_t i = 0; i < same.size(); ++i) {
    same[i].position = Vec3(0.5f, 0.1f, 0.2f);
    same[i].segments = static_cast<uint16_t>(i);
  }
  CHECK(found(PhotonGrid({same[0]}, scale), Vec3(0.5f, 0.1f, 0.205f), 0.01f).size() == 1);
  const std::vector<uint16_t> list = found(PhotonGrid(same, scale), Vec3(0.5f, 0.1f, 0.205f), 0.01f);
  REQUIRE(list.size() == 3000);
  CHECK(std::is_sorted(list.begin(), list.end()));  // equal cells keep the photons' order
}

TEST_CASE("photon grid: packed directions") {
  Rng rng(7);
  for (const auto& [bits, tolerance] : {std::pair(16, 8e-5f), std::pair(8, 2e-2f)}) {
    float worst = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vec3 d = squareToUniformSphere(rng.next2());
      worst = std::max(worst, glm::length(unpackDirection(packDirection(d, bits), bits) - d));
    }
    CHECK(worst < tolerance);
    for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)})
      CHECK(glm::length(unpackDirection(packDirection(axis, bits), bits) - axis) < tolerance);
  }
}

}  // namespace braid::test_photon_grid
