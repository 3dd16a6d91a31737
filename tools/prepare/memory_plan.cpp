// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/memory_plan.h"

#include <algorithm>

#include <fmt/format.h>

#include "braid/plan_combining.h"
#include "combiners/pipeline/pipeline_memory.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/exr_rows.h"
#include "renderer/session/integrator.h"
#include "tools/options/combining.h"
#include "tools/options/memory_limit.h"

namespace braid {

namespace {

constexpr double kBytesPerMebibyte = 1048576.0;
constexpr uint64_t kProgram = uint64_t(140) << 20;  // code and data of braid and the libraries that it opens

// OpenEXR holds a few copies of the rows that it compresses.
uint64_t writingBytes(const Plan& plan, const AvailableEstimates& available) {
  constexpr uint64_t kCopies = 3, kHeadline = 12;
  return static_cast<uint64_t>(exrRowsPerWrite()) * kCopies * static_cast<uint64_t>(plan.window.width()) *
         (static_cast<uint64_t>(estimatesMemory(available)) + kHeadline);
}

uint64_t historyBytes(const AvailableEstimates& available) {
  uint64_t bytes = 0;
  for (const AvailableEstimate& e : available.estimates)
    bytes += 12 * static_cast<uint64_t>(e.checkpoints) + 36 * static_cast<uint64_t>(e.kept.size());
  return bytes;
}

}  // namespace

uint64_t MemoryPlan::total() const {
  uint64_t bytes = 0;
  for (const MemoryItem& item : items) bytes += item.bytes;
  return bytes;
}

std::string MemoryPlan::text() const {
  std::vector<MemoryItem> sorted = items;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const MemoryItem& a, const MemoryItem& b) { return a.bytes > b.bytes; });
  std::string text = fmt::format("memory: {} at most", mebibytes(total()));
  const char* separator = ": ";
  for (const MemoryItem& item : sorted) {
    if (item.bytes < static_cast<uint64_t>(kBytesPerMebibyte / 10)) break;
    text += fmt::format("{}{} {}", separator, item.use, mebibytes(item.bytes));
    separator = ", ";
  }
  if (combinedOnce < total())
    text += fmt::format("; {} if nothing is combined before the end", mebibytes(combinedOnce));
  return text + '\n';
}

MemoryPlan planMemory(const Scene& scene, const Plan& plan, const std::vector<CombinePlan>& combinePlans,
                      uint64_t samples) {
  const auto pixels = static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height());
  const AvailableEstimates available = plannedEstimates(plan, samples);
  const MemoryItem film{"film", pixels * (plan.filmBytesPerPixel + historyBytes(available))};
  // The sums of indirect light are made for its variance.
  const uint64_t rest = plan.kept.directIndirect ? 24 * static_cast<uint64_t>(plan.buckets()) : 0;
  const MemoryItem copy{"the copy that is published",
                        pixels * (static_cast<uint64_t>(estimatesMemory(available)) + rest)};
  const int threads = plan.settings.threads > 0 ? plan.settings.threads : machineThreads();
  MemoryItem combining{"combining"};
  for (const CombinePlan& combinePlan : combinePlans)
    combining.bytes = std::max(combining.bytes, pipelineMemory(combinePlan, available, pixels, threads));
  const MemoryItem writing{"writing", writingBytes(plan, available)};
  MemoryPlan memory;
  memory.items = {{"program", kProgram},
                  {"hierarchies", scene.accel().bytes()},
                  {"geometry", scene.geometryBytes()},
                  {"textures", scene.textureBytes()}};
  const uint64_t always = memory.total();
  for (const PlannedIntegrator& p : plan.integrators)
    memory.items.push_back({std::string(p.integrator->name()) + " passes", p.integrator->workingMemory(plan).bytes});
  const uint64_t passes = memory.total() - always;
  // At the end the passes are over, and the film is given back before its copy is combined and written.
  memory.combinedOnce =
      always + std::max(film.bytes + passes, copy.bytes + std::max({film.bytes, combining.bytes, writing.bytes}));
  memory.items.push_back(film);
  memory.items.push_back(copy);
  memory.items.push_back(combining.bytes > writing.bytes ? combining : writing);
  return memory;
}

void requireWithinLimit(const MemoryPlan& plan) {
  if (plan.total() <= memoryLimit()) return;
  const auto most = std::max_element(plan.items.begin(), plan.items.end(),
                                     [](const MemoryItem& a, const MemoryItem& b) { return a.bytes < b.bytes; });
  throw Error(ExitCode::OutOfMemory,
              fmt::format("needs {} of memory, most of it, {}, for {}, and the limit is {}: lower --size or raise "
                          "--memory-limit",
                          mebibytes(plan.total()), mebibytes(most->bytes), most->use, mebibytes(memoryLimit())));
}

}  // namespace braid
