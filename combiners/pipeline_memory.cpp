// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline_memory.h"

#include <algorithm>

#include "combiners/pipeline.h"

namespace braid {

namespace {

constexpr int kColour = 3 * sizeof(float);
constexpr int kHalfEstimate = 4 * kColour;         // mean, variance, two halves
constexpr int kFeatureComponents = 3 + 3 + 1 + 1;  // albedo, normal, depth, visibility

int imagesOf(const EstimateFacts& e) {
  int bytes = kColour;
  if (e.halves) bytes += 2 * kColour;
  if (e.variance) bytes += kColour;
  if (e.quarters) bytes += 4 * kColour;
  if (e.bias) bytes += 4 * kColour;
  if (e.lightParts) bytes += 5 * kColour;
  return bytes;
}

int historyOf(const EstimateFacts& e) {
  return e.checkpoints * kColour + static_cast<int>(e.kept.size()) * 3 * kColour;
}

MemoryCase caseOf(const Step& step, const Recipe& recipe, const Facts& facts) {
  MemoryCase c;
  if (const EstimateFacts* e = facts.find(step.unbiased)) c.passes = step.kept > 0 ? step.kept : e->passes;
  c.bases = static_cast<int>(step.bases.size());
  for (const std::string& base : step.bases)
    if (const EstimateFacts* e = facts.find(base); e && e->bias) ++c.photonMaps;
  if (const EstimateFacts* e = facts.find(step.biased)) c.photonMap = e->bias;
  const Step* denoiser = recipe.find(step.biased);
  const EstimateFacts* e = facts.find(step.unbiased);
  c.denoiseHalf = denoiser && denoiser->method->halvesShareWeights() && denoiser->kept == 0 && e && e->halves &&
                  e->quarters && (e->passes == 0 || e->passes >= 4);
  return c;
}

// Of the step itself. A method that runs the denoiser of its input again holds that one's memory too, and a copy of the
// estimate with another mean, or one of half the samples. `given` are the facts before `facts` were copied.
MethodMemory memoryOf(const Step& step, const Recipe& recipe, const Facts& facts, const Facts& given) {
  const MemoryCase of = caseOf(step, recipe, given);
  MethodMemory memory = step.method->memory(of);
  const Step* denoiser = recipe.find(step.biased);
  const EstimateFacts* e = facts.find(step.unbiased);
  const bool redenoise = step.method->needs().redenoise;
  if ((!redenoise && memory.besideRedenoising == 0) || !denoiser || !e) return memory;
  const MethodMemory again = denoiser->method->memory(caseOf(*denoiser, recipe, given));
  memory.peak =
      std::max(memory.peak, memory.besideRedenoising + again.peak + (redenoise ? imagesOf(*e) : kHalfEstimate));
  memory.eachThread = std::max(memory.eachThread, again.eachThread);
  return memory;
}

// Of the estimates alone.
int colourMemory(const Facts& facts) {
  int bytes = 0;
  for (const EstimateFacts& e : facts.estimates) bytes += imagesOf(e) + historyOf(e);
  return facts.reference ? bytes + kColour : bytes;
}

// With the mean, two halves and the variance.
constexpr int kFeatureMemory = 4 * kFeatureComponents * static_cast<int>(sizeof(float));

Facts copiedFacts(Facts facts, const PlanesRead& read) {
  for (EstimateFacts& e : facts.estimates) {
    e.quarters &= read.quarters;
    e.lightParts &= read.lightParts;
    if (read.history) continue;
    e.checkpoints = 0;
    e.kept.clear();
  }
  facts.reference &= read.reference;
  return facts;
}

}  // namespace

int estimatesMemory(const Facts& facts) { return colourMemory(facts) + (facts.features ? kFeatureMemory : 0); }

uint64_t pipelineMemory(const Recipe& recipe, const Facts& given, uint64_t pixels, int threads) {
  const Facts facts = copiedFacts(given, planesRead(recipe));
  const int copy = colourMemory(facts);  // features are read as they are, unless they have bad values
  uint64_t kept = 0, peak = 0;           // bytes
  for (const Step& step : recipe.steps) {
    if (!step.obstacle.empty()) continue;
    const MethodMemory memory = memoryOf(step, recipe, facts, given);
    peak = std::max(
        peak, kept + pixels * static_cast<uint64_t>(memory.peak) + memory.eachThread * static_cast<uint64_t>(threads));
    kept += pixels * static_cast<uint64_t>(memory.kept);
  }
  return peak > 0 ? pixels * static_cast<uint64_t>(copy) + peak : 0;
}

}  // namespace braid
