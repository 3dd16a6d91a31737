// SPDX-License-Identifier: Apache-2.0
#include "tools/memory_plan.h"

#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <limits>

#include <fmt/format.h>

#include "combiners/pipeline_memory.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/exr_rows.h"
#include "renderer/session/integrator.h"
#include "tools/combining.h"

namespace braid {

namespace {

constexpr double kMebibyte = 1048576.0;
constexpr uint64_t kProgram = uint64_t(140) << 20;  // code and data of braid and the libraries that it starts with
constexpr uint64_t kLeastLimit = uint64_t(192) << 20;

// What the process reserves but never touches: Embree's heap, and stacks of the threads. The system counts it.
uint64_t reservedBytes() {
  return (uint64_t(160) << 20) + static_cast<uint64_t>(machineThreads()) * (uint64_t(16) << 20);
}

std::string mebibytes(uint64_t bytes) {
  const double size = static_cast<double>(bytes) / kMebibyte;
  return fmt::format("{:.{}f} MiB", size, size < 100 ? 1 : 0);
}

// OpenEXR holds a few copies of the rows that it compresses.
uint64_t writingBytes(const Plan& plan, const Facts& facts) {
  constexpr uint64_t kCopies = 3, kHeadline = 12;
  return static_cast<uint64_t>(exrRowsPerWrite()) * kCopies * static_cast<uint64_t>(plan.window.width()) *
         (static_cast<uint64_t>(estimatesMemory(facts)) + kHeadline);
}

uint64_t historyBytes(const Facts& facts) {
  uint64_t bytes = 0;
  for (const EstimateFacts& e : facts.estimates)
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
    if (item.bytes < static_cast<uint64_t>(kMebibyte / 10)) break;
    text += fmt::format("{}{} {}", separator, item.use, mebibytes(item.bytes));
    separator = ", ";
  }
  if (combinedOnce < total())
    text += fmt::format("; {} if nothing is combined before the end", mebibytes(combinedOnce));
  return text + '\n';
}

MemoryPlan planMemory(const Scene& scene, const Plan& plan, const Recipe& recipe, uint64_t samples) {
  const auto pixels = static_cast<uint64_t>(plan.window.width()) * static_cast<uint64_t>(plan.window.height());
  const Facts facts = plannedFacts(plan, samples);
  const MemoryItem film{"film", pixels * (plan.filmBytesPerPixel + historyBytes(facts))};
  // The sums of indirect light are made for its variance.
  const uint64_t rest = plan.lightParts ? 24 * static_cast<uint64_t>(plan.buckets) : 0;
  const MemoryItem copy{"the copy that is published", pixels * (static_cast<uint64_t>(estimatesMemory(facts)) + rest)};
  const int threads = plan.settings.threads > 0 ? plan.settings.threads : machineThreads();
  const MemoryItem combining{"combining", pipelineMemory(recipe, facts, pixels, threads)};
  const MemoryItem writing{"writing", writingBytes(plan, facts)};
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

uint64_t parseBytes(const std::string& text) {
  double number = 0;
  const char* end = text.data() + text.size();
  const auto [unit, error] = std::from_chars(text.data(), end, number);
  std::string suffix(unit, end);
  if (suffix.ends_with("iB")) suffix.resize(suffix.size() - 2);
  const int power = suffix == "M" ? 20 : suffix == "G" ? 30 : suffix == "T" ? 40 : 0;
  if (error != std::errc() || power == 0 || !(number > 0) || number > 1e6)
    throw Error(ExitCode::Usage,
                fmt::format("'{}': expected a size such as 512M, 4G or 1.5G, at most 1e6 of them", text));
  const auto bytes = static_cast<uint64_t>(number * static_cast<double>(uint64_t(1) << power));
  if (bytes < kLeastLimit)
    throw Error(ExitCode::Usage, fmt::format("'{}': expected at least {}", text, mebibytes(kLeastLimit)));
  return bytes;
}

void limitMemory(uint64_t bytes) {
  // Threads that cannot get their stacks end the process; so all of them start before.
  parallelFor(static_cast<size_t>(machineThreads()) * 16, [](size_t) {});
  rlimit limit{};
  getrlimit(RLIMIT_DATA, &limit);
  limit.rlim_cur = std::min<rlim_t>(bytes + reservedBytes(), limit.rlim_max);
  setrlimit(RLIMIT_DATA, &limit);
}

uint64_t memoryLimit() {
  rlimit limit{};
  getrlimit(RLIMIT_DATA, &limit);
  if (limit.rlim_cur == RLIM_INFINITY) return std::numeric_limits<uint64_t>::max();
  return limit.rlim_cur - std::min<uint64_t>(limit.rlim_cur, reservedBytes());
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
