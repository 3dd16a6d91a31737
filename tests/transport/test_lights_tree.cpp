// SPDX-License-Identifier: Apache-2.0
// The hierarchy of lights: choices have the probabilities that are claimed, and units do not change them.
#include <doctest/doctest.h>

#include "renderer/transport/lights/light_sampler.h"
#include "tests/support/counts.h"

namespace braid::test_lights_tree {

using test::Rng;

namespace {

// All tests of a case together raise a false alarm with this probability; the seeds are fixed.
constexpr double kFalseAlarm = 1e-3;

Vec3 randomPoint(Rng& rng) { return Vec3(rng.next(), rng.next(), rng.next()) * 2.0f - 1.0f; }
Vec3 randomDirection(Rng& rng) { return squareToUniformSphere(rng.next2()); }

LightBounds randomLight(Rng& rng) {
  LightBounds b;
  const int kind = static_cast<int>(4 * rng.next());
  const Vec3 centre = 10.0f * randomPoint(rng);
  const float size = kind < 2 ? std::exp(6 * rng.next() - 5) : 0.0f;
  b.bounds.extend(centre - size * Vec3(rng.next(), rng.next(), rng.next()));
  b.bounds.extend(centre + size * Vec3(rng.next(), rng.next(), rng.next()));
  b.axis = randomDirection(rng);
  b.power = std::exp(12 * rng.next() - 6);
  b.twoSided = kind == 1;
  if (kind == 2) b.cosNormals = -1;  // a point light
  if (kind == 3) {                   // a spot
    b.cosNormals = std::cos(1.5f * rng.next());
    b.cosEmission = std::cos(0.01f);
  }
  return b;
}

// Whether light reaches p with normal n from one corner of the bounds, clearly rather than within rounding.
bool contributes(const LightBounds& b, const Vec3& p, const Vec3& n, bool twoSided) {
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 q(corner & 1 ? b.bounds.hi.x : b.bounds.lo.x, corner & 2 ? b.bounds.hi.y : b.bounds.lo.y,
                 corner & 4 ? b.bounds.hi.z : b.bounds.lo.z);
    const Vec3 w = glm::normalize(p - q);
    float emit = glm::dot(b.axis, w);
    if (b.twoSided) emit = std::fabs(emit);
    const float angle = std::max(0.0f, std::acos(std::clamp(emit, -1.0f, 1.0f)) - std::acos(b.cosNormals));
    const float receive = twoSided ? std::fabs(glm::dot(w, n)) : -glm::dot(w, n);
    if (std::cos(angle) > b.cosEmission + 1e-4f && receive > 1e-4f) return true;
  }
  return false;
}

// Significance of the counts of a tree's choices against the probabilities it states. What is missing from 1 went to
// subtrees that turned out not to reach the point: those samples are lost, and counted in a cell of their own.
double choicesPValue(const LightTree& tree, size_t lights, const Vec3& p, const Vec3& n, Rng& rng, int count) {
  std::vector<double> observed(lights + 1, 0), expected(lights + 1, 0);
  for (int i = 0; i < count; ++i) {
    LightQuery query{p, n, false, rng.next()};
    tree.sample(query);
    observed[query.probability > 0 ? query.light : lights] += 1;
    if (!(query.probability > 0)) continue;
    if (i % 64 == 0) REQUIRE(tree.probability(query, query.light) == doctest::Approx(query.probability).epsilon(1e-4));
  }
  expected[lights] = count;
  for (size_t i = 0; i < lights; ++i) {
    expected[i] = count * static_cast<double>(tree.probability({p, n, false}, static_cast<uint32_t>(i)));
    expected[lights] -= expected[i];
  }
  return test::pValueOf(observed, expected);
}

double sumOfProbabilities(const LightTree& tree, size_t lights, const Vec3& p, const Vec3& n, bool twoSided) {
  double sum = 0;
  for (uint32_t i = 0; i < lights; ++i) sum += static_cast<double>(tree.probability({p, n, twoSided}, i));
  return sum;
}

}  // namespace

TEST_CASE("The hierarchy chooses each light with the probability it states, and one that contributes never with none") {
  Rng rng(3);
  constexpr int kTests = 30;
  int starved = 0, contributing = 0;
  for (int i = 0; i < kTests; ++i) {
    const float scale = std::pow(10.0f, static_cast<float>(i % 13 - 6));
    std::vector<LightBounds> bounds(static_cast<size_t>(1 + i * i / 3));
    for (LightBounds& b : bounds) {
      b = randomLight(rng);
      if (i % 5 == 4)
        b.bounds = bounds[0].bounds;  // all in one place
      else if (i % 5 == 3 && &b != &bounds[0] && rng.next() < 0.5f)
        b = bounds[0];  // coincident
    }
    for (LightBounds& b : bounds) b.bounds = {scale * b.bounds.lo, scale * b.bounds.hi};
    LightTree tree;
    tree.build(bounds);
    double worst = 0;
    for (int k = 0; k < 40; ++k) {
      const Vec3 p = scale * 12.0f * randomPoint(rng), n = k % 8 ? randomDirection(rng) : Vec3(0);
      const bool twoSided = k % 3 == 0;
      bool any = false;
      for (uint32_t l = 0; l < bounds.size(); ++l) {
        if (n != Vec3(0) && !contributes(bounds[l], p, n, twoSided)) continue;
        any = any || n != Vec3(0);
        ++contributing;
        starved += n != Vec3(0) && !(tree.probability({p, n, twoSided}, l) > 0);
      }
      if (any) worst = std::max(worst, std::fabs(sumOfProbabilities(tree, bounds.size(), p, n, twoSided) - 1));
    }
    CAPTURE(i);
    CHECK(worst <= 1.00001);
    const Vec3 p = scale * 12.0f * randomPoint(rng);
    CHECK(sumOfProbabilities(tree, bounds.size(), p, Vec3(0), false) < 1.0001);
    CHECK(choicesPValue(tree, bounds.size(), p, randomDirection(rng), rng, 40000) > test::sidak(kFalseAlarm, kTests));
  }
  CHECK(contributing > 1000);
  CHECK(starved == 0);
}

TEST_CASE("A hundred thousand lights are chosen as stated, and so is a single one") {
  Rng rng(4);
  std::vector<LightBounds> bounds(100000);
  for (LightBounds& b : bounds) b = randomLight(rng);
  LightTree tree;
  tree.build(bounds);
  const Vec3 p(1, 2, 3);
  const double sum = sumOfProbabilities(tree, bounds.size(), p, Vec3(0), false);
  CHECK((sum > 0.9 && sum < 1.0001));
  CHECK(choicesPValue(tree, bounds.size(), p, Vec3(0), rng, 200000) > kFalseAlarm);
  bounds.resize(1);
  tree.build(bounds);
  LightQuery query{p, Vec3(0), false, 0.3f};
  tree.sample(query);
  CHECK(query.light == 0);
  CHECK(query.probability == 1);
  CHECK(tree.probability({p, Vec3(0)}, 0) == 1);
}

TEST_CASE("Many lights picked together are those picked one by one, to the bit") {
  Rng rng(7);
  std::vector<LightBounds> bounds(3000);
  for (LightBounds& b : bounds) b = randomLight(rng);
  LightTree tree;
  tree.build(bounds);
  for (const size_t count : {size_t(1), size_t(7), size_t(64), size_t(203)}) {
    std::vector<LightQuery> together(count);
    for (LightQuery& query : together)
      query = {12.0f * randomPoint(rng), randomDirection(rng), rng.next() < 0.5f, rng.next()};
    std::vector<LightQuery> alone = together;
    tree.sample(together);
    for (size_t i = 0; i < count; ++i) {
      tree.sample(alone[i]);
      CHECK(together[i].light == alone[i].light);
      CHECK(together[i].probability == alone[i].probability);
    }
  }
}

TEST_CASE("A dim light keeps a chance beside one that is 10^12 times brighter") {
  for (const bool dimFirst : {false, true}) {
    std::vector<LightBounds> bounds(2);
    for (size_t i = 0; i < 2; ++i) {
      bounds[i].bounds.extend(Vec3(static_cast<float>(i), 0, 0));
      bounds[i].cosNormals = -1;
      bounds[i].power = (i == 0) == dimFirst ? 1e-6f : 1e6f;
    }
    LightTree tree;
    tree.build(bounds);
    // It may be all that lights this point: the bright one may be hidden.
    for (uint32_t i = 0; i < 2; ++i) CHECK(tree.probability({{0.5f, 1, 0}, {0, -1, 0}}, i) > 1e-4f);
    CHECK(sumOfProbabilities(tree, 2, {0.5f, 1, 0}, {0, -1, 0}, false) == doctest::Approx(1));
  }
}

TEST_CASE("The choice of a light depends neither on the unit of length nor on that of power") {
  Rng rng(5);
  std::vector<LightBounds> bounds(300);
  for (LightBounds& b : bounds) b = randomLight(rng);
  LightTree tree;
  tree.build(bounds);
  // Powers of two change no digit, so the probabilities must be equal in every bit.
  for (const float scale : {0x1p-20f, 0x1p-3f, 0x1p20f}) {
    for (const float power : {1.0f, 0x1p-20f, 0x1p20f}) {
      std::vector<LightBounds> scaled = bounds;
      for (LightBounds& b : scaled) {
        b.bounds = {scale * b.bounds.lo, scale * b.bounds.hi};
        b.power *= power;
      }
      LightTree other;
      other.build(scaled);
      int different = 0;
      Rng points(6);
      for (int k = 0; k < 50; ++k) {
        const Vec3 p = 12.0f * randomPoint(points), n = randomDirection(points);
        for (uint32_t i = 0; i < bounds.size(); ++i)
          different += tree.probability({p, n, k % 2 != 0}, i) != other.probability({scale * p, n, k % 2 != 0}, i);
      }
      CAPTURE(scale);
      CAPTURE(power);
      CHECK(different == 0);
    }
  }
}

}  // namespace braid::test_lights_tree
