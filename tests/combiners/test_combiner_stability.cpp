// SPDX-License-Identifier: Apache-2.0
// What every registered denoiser and combiner makes of usual and of extreme input: finite images of the right size, and
// nothing where there is nothing. Also run under sanitizers: images here are narrower, wider and higher than the parts
// that methods work in.
#include <cstring>

#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "tests/support/every_method.h"

namespace braid::test_combiner_stability {

using namespace test;

namespace {

bool finiteResult(const MethodResult& r) { return badPlanes(r).empty(); }

void runsFinite(const Method& method, const Estimates& estimates) {
  const PipelineOutput out = outputOf(method, estimates);
  INFO(std::string(method.name()), ": ", out.step.skipReason);
  REQUIRE(out.ran());
  CHECK(out.result.image.mean.width() == estimates.width);
  CHECK(out.result.image.mean.height() == estimates.height);
  CHECK(badPlanes(out.result) == "");
}

// Puts bad values over the planes of an image, a different one every few pixels.
void spoil(Rgb<float>& image, size_t offset) {
  const float bad[] = {std::nanf(""), kInfinity, -kInfinity, -1.0f, 3e38f, -3e38f};
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = (offset + 5 * c) % 23; i < image.size(); i += 23) image[c][i] = bad[(i / 23 + offset) % 6];
}

Estimates spoiled(const Case& c) {
  Estimates e = everything(c);
  size_t offset = 0;
  spoil(e.reference, offset++);
  for (Estimate& x : e.estimates) {
    spoil(x.mean, offset++);
    for (Rgb<float>& half : x.half) spoil(half, offset++);
    for (Rgb<float>& q : x.quarter) spoil(q, offset++);
    for (Rgb<float>* image : {&x.variance, &x.bias, &x.biasHalf[0], &x.biasHalf[1], &x.biasVariance})
      spoil(*image, offset++);
  }
  for (Checkpoint& k : e.history["pt"]) spoil(k.variance, offset++);
  for (FeaturePlanes<Rgb<float>>* f : {&e.features->albedo, &e.features->normal})
    for (Rgb<float>* image : {&f->mean, &f->half[0], &f->half[1], &f->variance}) spoil(*image, offset++);
  for (FeaturePlanes<Plane<float>>* f : {&e.features->depth, &e.features->visibility})
    for (Plane<float>* plane : {&f->mean, &f->half[0], &f->half[1], &f->variance})
      for (size_t i = offset++ % 23; i < plane->size(); i += 23) (*plane)[i] = i % 2 ? std::nanf("") : kInfinity;
  return e;
}

}  // namespace

TEST_CASE("Every method runs on a usual image, and its halves look like it") {
  const Case c = makeCase(sized(48, 36, 32));
  const Estimates e = everything(c);
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    const PipelineOutput out = outputOf(*m, e);
    INFO(out.step.skipReason);
    REQUIRE(out.ran());
    CHECK(badPlanes(out.result) == "");
    // Nothing is a worse guess of the truth than black.
    CHECK(meanSquaredError(out.result.image.mean, c.truth) < 0.5 * meanSquaredError(Rgb<float>(48, 36), c.truth));
    const Estimate& image = out.result.image;
    if (image.half[0].empty()) continue;
    for (const Rgb<float>& half : image.half) CHECK(relativeDistance(half, image.mean) < 0.5);
  }
}

TEST_CASE("Bad values in every input leave every method with a finite image") {
  const Estimates e = spoiled(makeCase(sized(40, 30)));
  for (const auto& m : runnableMethods()) runsFinite(*m, e);
}

TEST_CASE("Images without variance, without light and of any size come out finite") {
  CaseOptions noiseless = sized(40, 30);
  noiseless.noise = noiseless.correlatedNoise = noiseless.photonNoise = noiseless.featureNoise = 0;
  CaseOptions black = sized(40, 30);
  black.light = 0;
  CaseOptions fireflies = sized(40, 30);
  fireflies.fireflies = 0.002;
  for (const CaseOptions& o : {noiseless, black, fireflies, sized(1, 1), sized(7, 3), sized(257, 89, 8)}) {
    const Case c = makeCase(o);
    const Estimates e = everything(c);
    CAPTURE(o.width);
    for (const auto& m : runnableMethods()) runsFinite(*m, e);
  }
}

TEST_CASE("All-black images stay black") {
  CaseOptions black = sized(24, 20);
  black.light = 0;
  const Case c = makeCase(black);
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    CHECK(meanSquaredError(outputOf(*m, everything(c)).result.image.mean, c.truth) == 0);
  }
}

TEST_CASE("One sample is enough, or refused with a reason, and never harmful") {
  const Case c = makeCase(sized(24, 20, 1));
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    const PipelineOutput out = outputOf(*m, everything(c));
    if (out.ran())
      CHECK(badPlanes(out.result) == "");
    else
      CHECK(out.step.skipReason.find("needs ") != std::string::npos);
    MethodInputs direct = inputsOf(c, "wide");
    bool ok = false;
    try {
      ok = finiteResult(m->run(direct));
    } catch (const Error& e) {
      ok = std::strlen(e.what()) > 10;  // a sentence
    }
    CHECK(ok);
  }
}

TEST_CASE("A constant image without noise is invariant") {
  CaseOptions o = sized(40, 30);
  o.noise = o.correlatedNoise = o.photonNoise = 0;
  o.constant = 0.7;
  const Case c = makeCase(o);
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    // Rounding through normalisation, regression and normalised weights. A network only comes near.
    const double most = dynamic_cast<const ExternalMethod*>(m.get()) ? 0.05 : 1e-4;
    CHECK(relativeDistance(outputOf(*m, everything(c)).result.image.mean, c.truth) < most);
  }
}

}  // namespace braid::test_combiner_stability
