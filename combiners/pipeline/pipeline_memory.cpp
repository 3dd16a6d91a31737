// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/pipeline_memory.h"

#include <algorithm>

#include "combiners/pipeline/pipeline.h"

namespace braid {

namespace {

constexpr int kColour = 3 * sizeof(float);
constexpr int kHalfEstimate = 4 * kColour;  // mean, variance, two halves

int imagesOf(const AvailableEstimate& e) {
  int bytes = kColour;
  if (e.halves) bytes += 2 * kColour;
  if (e.variance) bytes += kColour;
  if (e.quarters) bytes += 4 * kColour;
  if (e.bias) bytes += 4 * kColour;
  if (e.directIndirect) bytes += 5 * kColour;
  return bytes;
}

int historyOf(const AvailableEstimate& e) {
  return e.checkpoints * kColour + static_cast<int>(e.kept.size()) * 3 * kColour;
}

MemoryCase caseOf(const Step& step, const CombinePlan& combinePlan, const AvailableEstimates& available) {
  MemoryCase c;
  if (const AvailableEstimate* e = available.find(step.unbiased)) c.passes = step.kept > 0 ? step.kept : e->passes;
  c.bases = static_cast<int>(step.bases.size());
  for (const std::string& base : step.bases)
    if (const AvailableEstimate* e = available.find(base); e && e->bias) ++c.photonMaps;
  if (const AvailableEstimate* e = available.find(step.biased)) c.photonMap = e->bias;
  const Step* denoiser = combinePlan.find(step.biased);
  const AvailableEstimate* e = available.find(step.unbiased);
  c.denoiseHalf = denoiser && denoiser->method->halvesShareWeights() && denoiser->kept == 0 && e && e->halves &&
                  e->quarters && (e->passes == 0 || e->passes >= 4);
  return c;
}

// Of the step itself. A method that runs the denoiser of its input again holds that one's memory too, and a copy of the
// estimate with another mean, or one of half the samples. `given` are the available before `available` were copied.
MethodMemory memoryOf(const Step& step, const CombinePlan& combinePlan, const AvailableEstimates& available,
                      const AvailableEstimates& given) {
  const MemoryCase of = caseOf(step, combinePlan, given);
  MethodMemory memory = step.method->memory(of);
  const Step* denoiser = combinePlan.find(step.biased);
  const AvailableEstimate* e = available.find(step.unbiased);
  const bool redenoise = step.method->needs().redenoise;
  if ((!redenoise && memory.besideRedenoising == 0) || !denoiser || !e) return memory;
  const MethodMemory again = denoiser->method->memory(caseOf(*denoiser, combinePlan, given));
  memory.peak =
      std::max(memory.peak, memory.besideRedenoising + again.peak + (redenoise ? imagesOf(*e) : kHalfEstimate));
  memory.eachThread = std::max(memory.eachThread, again.eachThread);
  return memory;
}

// Of the estimates alone.
int colourMemory(const AvailableEstimates& available) {
  int bytes = 0;
  for (const AvailableEstimate& e : available.estimates) bytes += imagesOf(e) + historyOf(e);
  return available.reference ? bytes + kColour : bytes;
}

// With the mean, two halves and the variance.
constexpr int kFeatureMemory = 4 * static_cast<int>(kFeatureComponents * sizeof(float));

AvailableEstimates copiedAvailable(AvailableEstimates available, const PlanesRead& planes) {
  const KeptBuffers& read = planes.buffers;
  for (AvailableEstimate& e : available.estimates) {
    e.quarters &= read.quarters;
    e.directIndirect &= read.directIndirect;
    if (read.history) continue;
    e.checkpoints = 0;
    e.kept.clear();
  }
  available.reference &= planes.reference;
  return available;
}

}  // namespace

int estimatesMemory(const AvailableEstimates& available) {
  return colourMemory(available) + (available.features ? kFeatureMemory : 0);
}

uint64_t pipelineMemory(const CombinePlan& combinePlan, const AvailableEstimates& given, uint64_t pixels, int threads) {
  const AvailableEstimates available = copiedAvailable(given, planesRead(combinePlan));
  const int copy = colourMemory(available);  // features are read as they are, unless they have bad values
  uint64_t kept = 0, peak = 0;               // bytes
  for (const Step& step : combinePlan.steps) {
    if (!step.skipReason.empty()) continue;
    const MethodMemory memory = memoryOf(step, combinePlan, available, given);
    peak = std::max(
        peak, kept + pixels * static_cast<uint64_t>(memory.peak) + memory.eachThread * static_cast<uint64_t>(threads));
    kept += pixels * static_cast<uint64_t>(memory.kept);
  }
  return peak > 0 ? pixels * static_cast<uint64_t>(copy) + peak : 0;
}

}  // namespace braid
