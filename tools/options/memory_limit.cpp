// SPDX-License-Identifier: Apache-2.0
#include "tools/options/memory_limit.h"

#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <limits>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/images/image_codecs.h"

namespace braid {

namespace {

constexpr double kMebibyte = 1048576.0;
constexpr uint64_t kLeastLimit = uint64_t(192) << 20;

// What the process reserves but never touches: Embree's heap, and stacks of the threads. The system counts it.
uint64_t reservedBytes() {
  return (uint64_t(160) << 20) + static_cast<uint64_t>(machineThreads()) * (uint64_t(16) << 20);
}

}  // namespace

std::string mebibytes(uint64_t bytes) {
  const double size = static_cast<double>(bytes) / kMebibyte;
  return fmt::format("{:.{}f} MiB", size, size < 100 ? 1 : 0);
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
  // What reads and writes images must not be without the memory that it needs to be opened.
  imageCodecs();
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

}  // namespace braid
