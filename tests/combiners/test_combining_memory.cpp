// SPDX-License-Identifier: Apache-2.0
// Methods take the memory that they say they take, and so does the pipeline.
#include <doctest/doctest.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/pipeline.h"
#include "combiners/pipeline/pipeline_memory.h"
#include "combiners/pipeline/registry.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/counted_memory.h"

namespace braid::test_combining_memory {

using namespace test;

namespace {

constexpr int kWidth = 384, kHeight = 256, kThreads = 2;

double perPixel(int64_t bytes) { return static_cast<double>(bytes) / (kWidth * kHeight); }

// With a firefly in each of the unbiased images: methods that take such out make copies.
Case caseOf(uint64_t samples) {
  CaseOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.samples = samples;
  Case c = makeCase(options);
  for (size_t k = 0; k < 2; ++k) {
    Estimate& e = c.estimates.estimates[k];
    for (size_t channel = 0; channel < 3; ++channel) {
      const size_t i = e.mean[channel].index(100, 50 + 100 * static_cast<int>(k));
      e.mean[channel][i] += 1000;
      e.half[1][channel][i] += 2000;
      if (!e.quarter.empty()) e.quarter[3][channel][i] += 4000;
      if (!e.variance.empty()) e.variance[channel][i] += 1e6f;
    }
  }
  return c;
}

// The same with a third of the light direct.
Case withDirectIndirect(Case c) {
  Estimate& e = c.estimates.estimates[0];
  e.direct = {e.mean, {e.half[0], e.half[1]}, e.variance};
  for (Rgb<float>* image : {&e.direct.mean, &e.direct.half[0], &e.direct.half[1]})
    for (Plane<float>& plane : image->channel)
      for (float& value : plane.data) value /= 3;
  e.indirectVariance = e.variance;
  return c;
}

MethodInputs inputsOf(const Case& c, const std::vector<const char*>& bases, const char* biased) {
  MethodInputs in;
  in.unbiased = &c.pt();
  in.correlated = &c.crn();
  in.biased = &c.find(biased);
  in.features = &*c.estimates.features;
  in.reference = &c.truth;
  in.history = &c.estimates.history.at("pt");
  in.redenoise = [](const Rgb<float>& image) { return image; };
  for (const char* name : bases) in.bases.push_back(&c.find(name));
  return in;
}

void checkMemory(const Method& method, const Case& c, const std::vector<const char*>& bases,
                 const char* biased = "narrow") {
  const MethodInputs in = inputsOf(c, bases, biased);
  MemoryCase of{c.pt().passes, static_cast<int>(bases.size()), 0};
  for (const Estimate* base : in.bases) of.photonMaps += base->bias.empty() ? 0 : 1;
  of.photonMap = !in.biased->bias.empty();
  const MethodMemory stated = method.memory(of);
  const int64_t before = heapBytes();
  resetHeapPeak();
  const MethodResult result = method.run(in);
  INFO(std::string(method.name()), " of ", std::string(biased), " with ", bases.size(), " bases after ", of.passes,
       " passes");
  // On a busy machine one thread may have done all the work before another has begun.
  const double thread = perPixel(static_cast<int64_t>(stated.eachThread)), peak = perPixel(heapPeak() - before);
  CHECK(peak < 1.1 * (stated.peak + kThreads * thread));
  CHECK(peak > 0.9 * (stated.peak + thread));
  CHECK(perPixel(heapBytes() - before) == doctest::Approx(stated.kept).epsilon(0.1));
}

}  // namespace

TEST_CASE("every method states its memory to 10 %") {
  const std::vector<std::vector<const char*>> baseSets{
      {}, {"narrow"}, {"narrow", "wide"}, {"sppm"}, {"sppm", "narrow"}, {"sppm", "narrow", "wide", "narrow"}};
  for (const uint64_t samples : {2u, 16u, 64u}) {
    const Case c = caseOf(samples);
    withThreads(kThreads, [&] {
      for (const auto& method : makeMethods()) {
        if (dynamic_cast<const ExternalMethod*>(method.get())) continue;
        const Needs needs = method->needs();
        if (c.pt().passes < needs.passes) continue;
        // Between few and many passes only this one differs.
        if (samples == 16 && std::string(method->name()) != "auto") continue;
        for (const auto& bases : baseSets)
          if (static_cast<int>(bases.size()) >= needs.bases && (needs.anyBases || needs.bases > 0 || bases.empty()))
            checkMemory(*method, c, bases);
        if (needs.biased && !needs.redenoise && needs.bases == 0) checkMemory(*method, c, {}, "sppm");
      }
    });
  }
}

TEST_CASE("auto states its memory where it filters direct and indirect light apart") {
  const std::shared_ptr<const Method> method = findMethod("auto");
  for (const uint64_t samples : {2u, 16u, 64u}) {
    const Case c = withDirectIndirect(caseOf(samples));
    withThreads(kThreads, [&] {
      for (const std::vector<const char*>& bases :
           std::vector<std::vector<const char*>>{{}, {"narrow"}, {"narrow", "wide"}, {"sppm"}})
        checkMemory(*method, c, bases);
    });
  }
}

TEST_CASE("the pipeline takes the memory that follows from a combine plan") {
  Case c = withDirectIndirect(caseOf(16));
  c.estimates.reference = c.truth;
  const AvailableEstimates available = availableIn(c.estimates);
  PipelineOptions options;
  options.roles.helpers = false;  // networks state the most that they can take
  for (const std::vector<std::string>& wanted : std::vector<std::vector<std::string>>{
           {"auto"}, {"js@nfor"}, {"js@rdfc"}, {"ensemble@pw+nlm+rdfc"}, {"curves@nlm"}, {"ideal@pw"}}) {
    const uint64_t stated =
        pipelineMemory(makeCombinePlan(available, wanted, options.roles), available, kWidth * kHeight, kThreads);
    const int64_t before = heapBytes();
    resetHeapPeak();
    withThreads(kThreads, [&] { runPipeline(c.estimates, wanted, options); });
    INFO(wanted[0]);
    CHECK(static_cast<double>(heapPeak() - before) == doctest::Approx(static_cast<double>(stated)).epsilon(0.1));
  }
}

TEST_CASE("estimates take the memory that follows from their available") {
  const Case c = withDirectIndirect(caseOf(4));
  const int64_t before = heapBytes();
  const Estimates copy = c.estimates;
  CHECK(perPixel(heapBytes() - before) == doctest::Approx(estimatesMemory(availableIn(copy))).epsilon(0.02));
}

}  // namespace braid::test_combining_memory
