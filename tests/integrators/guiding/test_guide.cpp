// SPDX-License-Identifier: Apache-2.0
// The learned density of directions and its mixture with a BSDF: what is sampled follows the density that is evaluated,
// which adds up to 1; what is learned has the shape that makes the variance least. The statistical tests fail a correct
// source once in 10 000 sets of seeds each; the seeds are fixed.
#include <doctest/doctest.h>

#include "integrators/guiding/guide_record.h"
#include "tests/support/bsdf_cases.h"
#include "tests/support/render_fixture.h"

namespace braid::test_guide {

using namespace test;

namespace {

std::vector<DirectionalPoint> pointsAbout(const Vec3& direction, float spread, size_t count, uint64_t seed) {
  Rng rng(seed);
  std::vector<DirectionalPoint> points;
  for (size_t i = 0; i < count; ++i) {
    const Vec3 offset(rng.next() - 0.5f, rng.next() - 0.5f, rng.next() - 0.5f);
    points.push_back({squareOfDirection(glm::normalize(direction + spread * offset)), 0.5f + rng.next()});
  }
  return points;
}

// A guide, and what it was learned from: light on a floor from about one direction, a tenth of it from anywhere.
struct Lesson {
  std::vector<GuidePhoton> photons;
  std::vector<GuideRecord> records;

  Guide learn(float scale = 1) const { return learnGuide(photons, records, std::vector<float>{scale}); }
};

Lesson lessonOf(const Vec3& direction, size_t count, uint64_t seed, bool narrow = false) {
  Rng rng(seed);
  Lesson lesson;
  const auto surface = static_cast<uint32_t>(guideClass(Vec3(0, 0, 1), narrow));
  for (size_t i = 0; i < count; ++i) {
    const Vec3 offset(rng.next() - 0.5f, rng.next() - 0.5f, rng.next() - 0.5f);
    const bool anywhere = rng.next() < 0.1f;
    const Vec3 w = anywhere ? squareToUniformHemisphere(rng.next2()) : glm::normalize(direction + 0.4f * offset);
    const Vec3 position(rng.next(), rng.next(), 0);
    const Vec2 place = squareOfDirection(toGuideAxes(static_cast<int>(surface), w));
    lesson.photons.push_back({position, place, 1, surface});
    GuideRecord r{};
    r.position = position;
    r.bsdfPdfW = w.z * kInvPi;
    r.guidePdfW = anywhere ? 0.01f : 1.0f;
    r.pdfW = 0.5f * (r.bsdfPdfW + r.guidePdfW);
    r.value = anywhere ? 0.1f : 1.0f;
    r.guided = 1;
    r.surface = surface & 0xfu;
    lesson.records.push_back(r);
  }
  return lesson;
}

// For surfaces of both kinds of lobes.
Guide guideForAll(const Vec3& direction) {
  Lesson lesson = lessonOf(direction, 2000, 1);
  const Lesson narrow = lessonOf(direction, 2000, 2, true);
  lesson.photons.insert(lesson.photons.end(), narrow.photons.begin(), narrow.photons.end());
  lesson.records.insert(lesson.records.end(), narrow.records.begin(), narrow.records.end());
  return lesson.learn();
}

const Vec3 kLight = glm::normalize(Vec3(0.6f, -0.3f, 0.7f));

Hit floorHit() {
  Hit hit{};
  hit.position = Vec3(0.4f, 0.6f, 0);
  hit.ng = Vec3(0, 0, 1);
  hit.frame = Frame(hit.ng);
  return hit;
}

// Sums of a bounded variate in each octant.
struct OctantSums {
  std::array<double, 8> sum{}, squares{};
  double count = 0;

  void add(const Vec3& w, float value) {
    const size_t o = (w.x > 0 ? 1u : 0u) + (w.y > 0 ? 2u : 0u) + (w.z > 0 ? 4u : 0u);
    sum[o] += static_cast<double>(value);
    squares[o] += sqr(static_cast<double>(value));
  }
  double mean(size_t o) const { return sum[o] / count; }
  double variance(size_t o) const { return (squares[o] / count - sqr(mean(o))) / count; }
};

// The largest |z| between two estimates of the same eight numbers.
double largestZ(const OctantSums& a, const OctantSums& b) {
  double z = 0;
  for (size_t o = 0; o < 8; ++o) {
    const double variance = a.variance(o) + b.variance(o) + sqr(1e-4);
    z = std::max(z, std::fabs(a.mean(o) - b.mean(o)) / std::sqrt(variance));
  }
  return z;
}

SampleBlock randomBlock(Rng& rng) {
  SampleBlock block;
  for (float& u : block.u) u = rng.next();
  return block;
}

}  // namespace

TEST_CASE("guiding: the map of directions inverts itself, and its stretch makes up for its areas") {
  Rng rng(3);
  double covered = 0, upper = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec2 p = rng.next2();
    // Uniform places over their density per steradian cover the sphere: 4π, and as much of a double wedge as it has.
    covered += 1 / static_cast<double>(squareStretch(directionOfSquare(p))) / 20000;
    if (directionOfSquare(p).y > std::fabs(directionOfSquare(p).x) * std::sqrt(3.0f))
      upper += 1 / static_cast<double>(squareStretch(directionOfSquare(p))) / 20000;
    const Vec3 w = directionOfSquare(p);
    CHECK(std::fabs(glm::length(w) - 1) < 1e-5f);
    CHECK(glm::length(directionOfSquare(squareOfDirection(w)) - w) < 2e-3f);
  }
  CHECK(covered == doctest::Approx(1).epsilon(0.01));
  CHECK(upper == doctest::Approx(1.0 / 6).epsilon(0.05));
  for (const Vec3& w : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(-1, -1e-30f, 0),
                        Vec3(0, 1, 0), Vec3(0, -1, 0)}) {
    const Vec2 p = squareOfDirection(w);
    CHECK(p.x >= 0);
    CHECK(p.x < 1);
    CHECK(p.y >= 0);
    CHECK(p.y < 1);
  }
}

TEST_CASE("guiding: a class's axes turn its normals to the pole and back") {
  Rng rng(4);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 n = directionOfSquare(rng.next2()), w = directionOfSquare(rng.next2());
    const int surface = guideClass(n, i % 2 == 0);
    CHECK(surface >= 0);
    CHECK(surface < kGuideClasses);
    CHECK(toGuideAxes(surface, n).z >= 0.57f);
    CHECK(fromGuideAxes(surface, toGuideAxes(surface, w)) == w);
  }
}

TEST_CASE("guiding: directions of a tree follow its density, which adds up to 1") {
  constexpr int kCases = 6, kCells = 16, kFine = 512, kSamples = 40000;
  const float spreads[kCases] = {0.02f, 0.1f, 0.5f, 1, 3, 20};
  for (int k = 0; k < kCases; ++k) {
    auto points = pointsAbout(directionOfSquare({0.3f + 0.1f * static_cast<float>(k), 0.9f}), spreads[k], 4000, 10);
    const DirectionalTable table(buildDirectionalTree(points));
    std::vector<double> expected(kCells * kCells), observed(kCells * kCells);
    const auto cellOf = [](const Vec2& p) {
      return static_cast<size_t>(static_cast<int>(p.y * kCells) * kCells + static_cast<int>(p.x * kCells));
    };
    double integral = 0;
    for (int i = 0; i < kFine * kFine; ++i) {
      const Vec2 p((static_cast<float>(i % kFine) + 0.5f) / kFine, (static_cast<float>(i / kFine) + 0.5f) / kFine);
      const double part = static_cast<double>(table.density(p)) / (kFine * kFine);
      expected[cellOf(p)] += part * kSamples;
      integral += part;
    }
    Rng rng(20 + static_cast<uint64_t>(k));
    int others = 0;  // on the edge of a square, rounding may take the neighbour's density
    for (int i = 0; i < kSamples; ++i) {
      float density = 0;
      const Vec2 place = table.sample(rng.next2(), density);
      others += std::fabs(density - table.density(place)) > 1e-4f * density ? 1 : 0;
      observed[cellOf(place)] += 1;
    }
    double statistic = 0, pooledExpected = 0, pooledObserved = 0, cells = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      pooledExpected += expected[i];
      pooledObserved += observed[i];
      if (pooledExpected < 10) continue;
      statistic += sqr(pooledObserved - pooledExpected) / pooledExpected;
      pooledExpected = pooledObserved = 0;
      ++cells;
    }
    INFO("spread " << spreads[k] << ", cells " << cells);
    CHECK(integral == doctest::Approx(1).epsilon(1e-4));
    CHECK(others < kSamples / 1000);
    if (cells > 1) CHECK(gammaQ(0.5 * (cells - 1), 0.5 * statistic) > sidak(1e-4, kCases));
  }
}

TEST_CASE("guiding: a tree's density goes as the power per area") {
  // One quarter of the square has 9 times the power of each of the others, spread evenly.
  Rng rng(5);
  std::vector<DirectionalPoint> points;
  for (int i = 0; i < 40000; ++i) {
    const Vec2 p = rng.next2();
    points.push_back({p, p.x < 0.5f && p.y < 0.5f ? 9.0f : 1.0f});
  }
  const DirectionalTable table(buildDirectionalTree(points));
  const float inside = table.density({0.2f, 0.3f}), outside = table.density({0.7f, 0.8f});
  CHECK(inside / outside == doctest::Approx(9).epsilon(0.2));
}

TEST_CASE("guiding: without power, or with that of one point, a tree is a density still") {
  for (const size_t count : {0, 1}) {
    std::vector<DirectionalPoint> points(count, DirectionalPoint{Vec2(0.1f, 0.2f), 1e30f});
    const DirectionalTable table(buildDirectionalTree(points));
    double sum = 0;
    for (int i = 0; i < 64; ++i)
      sum += static_cast<double>(
          table.density({(static_cast<float>(i % 8) + 0.5f) / 8, (static_cast<float>(i / 8) + 0.5f) / 8}));
    CHECK(sum / 64 == doctest::Approx(1));
  }
  std::vector<DirectionalPoint> black(100, DirectionalPoint{Vec2(0.1f, 0.2f), 0});
  CHECK(DirectionalTable(buildDirectionalTree(black)).density({0.9f, 0.9f}) == 1);
}

// Weighed with h / pdf, samples of the mixture estimate ∫ h: with h the density of the BSDF or of the guide, the weight
// is bounded, however narrow a lobe is, and samples of these alone estimate the same.
TEST_CASE("guiding: samples of the mixture follow its density for every material") {
  constexpr int kSamples = 20000;
  const auto cases = bsdfCases();
  const auto views = viewDirections();
  const Guide guide = guideForAll(kLight);
  const Hit hit = floorHit();
  Rng rng(500);
  for (size_t k = 0; k < cases.size(); ++k) {
    const Bsdf bsdf(cases[k].p, views[k % views.size()]);
    if (!bsdf.hasNonDelta()) continue;
    const GuidedBsdf guided(bsdf, guide, hit);
    REQUIRE(guided.guided());
    const int surface = guideClass(hit.ng, GuidedBsdf::isNarrow(bsdf));
    const DirectionalTable& table = guide.table(*guide.find(surface, hit.position));
    OctantSums byBsdf, byGuide, ofBsdf, ofGuide;
    byBsdf.count = byGuide.count = ofBsdf.count = ofGuide.count = kSamples;
    int others = 0;  // on the edge of a square of the guide, rounding may take the neighbour's density
    for (int i = 0; i < kSamples; ++i) {
      GuidedSample s;
      if (guided.sample(randomBlock(rng), s) && !s.delta) {
        others += std::fabs(guided.evaluate(s.wi).pdfW - s.pdfW) > 0.02f * s.pdfW ? 1 : 0;
        byBsdf.add(s.wi, s.bsdfPdfW / s.pdfW);
        byGuide.add(s.wi, s.guidePdfW / s.pdfW);
      }
      BsdfSample plain;
      const float uLobe = rng.next();
      if (bsdf.sample(uLobe, rng.next2(), plain) && !plain.delta) ofBsdf.add(plain.wi, 1);
      float density = 0;
      const Vec3 w = fromGuideAxes(surface, directionOfSquare(table.sample(rng.next2(), density)));
      if (!isBlack(bsdf.evaluate(hit.frame.toLocal(w)).f)) ofGuide.add(hit.frame.toLocal(w), 1 - bsdf.deltaShare());
    }
    INFO(cases[k].name << ", wo.z " << views[k % views.size()].z);
    CHECK(others < kSamples / 1000);
    CHECK(largestZ(byBsdf, ofBsdf) < zLimit(16 * cases.size()));
    CHECK(largestZ(byGuide, ofGuide) < zLimit(16 * cases.size()));
  }
}

TEST_CASE("guiding: weights of the mixture are values over its density, and delta lobes keep theirs") {
  const Guide guide = guideForAll(kLight);
  const Hit hit = floorHit();
  Rng rng(9);
  for (const BsdfCase& c : bsdfCases()) {
    const Bsdf bsdf(c.p, viewDirections().front());
    const GuidedBsdf guided(bsdf, guide, hit);
    int deltas = 0, plainDeltas = 0;
    for (int i = 0; i < 2000; ++i) {
      SampleBlock block;
      for (float& u : block.u) u = rng.next();
      GuidedSample s;
      BsdfSample plain;
      const bool found = guided.sample(block, s);
      const bool alone = bsdf.sample(block.u[slot::kLobe], {block.u[slot::kBsdfU], block.u[slot::kBsdfV]}, plain);
      plainDeltas += alone && plain.delta ? 1 : 0;
      if (!found) continue;
      if (s.delta) {
        ++deltas;
        CHECK(s.weight == plain.weight);
        continue;
      }
      const float expected = maxComponent(bsdf.evaluate(s.wi).f / s.pdfW), got = maxComponent(s.weight);
      INFO(c.name);
      CHECK(got == doctest::Approx(expected).epsilon(0.02));
    }
    CHECK(deltas == plainDeltas);
  }
}

TEST_CASE("guiding: the share goes to the guide where it knows the light, and to the BSDF where it does not") {
  const int surface = guideClass(Vec3(0, 0, 1), false);
  Lesson lesson = lessonOf(kLight, 2000, 1);
  const Guide good = lesson.learn();
  const GuideRegion* region = good.find(surface, Vec3(0.5f, 0.5f, 0));
  REQUIRE(region != nullptr);
  CHECK(region->share > 0.5f);
  for (GuideRecord& r : lesson.records) r.guidePdfW = 0.01f * r.bsdfPdfW;
  CHECK(lesson.learn().find(surface, Vec3(0.5f, 0.5f, 0)) == nullptr);
}

TEST_CASE("guiding: nothing is learned from nothing, and other surfaces are left alone") {
  const Guide empty = Lesson().learn();
  CHECK(empty.regions() == 0);
  for (int c = 0; c < kGuideClasses; ++c) CHECK(empty.find(c, Vec3(1e30f, -1e30f, 0)) == nullptr);
  // Records without photons, and photons without records.
  Lesson lesson = lessonOf(kLight, 2000, 1);
  lesson.photons.clear();
  CHECK(lesson.learn().regions() == 0);
  lesson = lessonOf(kLight, 2000, 1);
  lesson.records.clear();
  const Guide floor = lesson.learn();
  CHECK(floor.find(guideClass(Vec3(0, 0, -1), false), Vec3(0.5f, 0.5f, 0)) == nullptr);
  CHECK(floor.find(guideClass(Vec3(0, 0, 1), false), Vec3(1e30f, -1e30f, 0)) != nullptr);
}

TEST_CASE("guiding: huge and tiny values and scenes are learned like others") {
  const int surface = guideClass(Vec3(0, 0, 1), false);
  for (const float size : {1e-20f, 1.0f, 1e18f}) {
    Lesson lesson = lessonOf(kLight, 2000, 1);
    for (GuidePhoton& p : lesson.photons) {
      p.position *= size;
      p.power *= size;
    }
    for (GuideRecord& r : lesson.records) {
      r.position *= size;
      r.value *= size;
    }
    const Guide guide = lesson.learn(1 / size);
    const GuideRegion* region = guide.find(surface, size * Vec3(0.5f, 0.5f, 0));
    REQUIRE(region != nullptr);
    CHECK(guide.table(*region).density(squareOfDirection(toGuideAxes(surface, kLight))) > 4);
  }
}

}  // namespace braid::test_guide
