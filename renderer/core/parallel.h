// SPDX-License-Identifier: Apache-2.0
// Parallel loops over fixed chunks: what a chunk holds never depends on the number of threads, so results do not
// either.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <vector>

namespace braid {

// Pixels of a chunk in loops over images: long against the cost of a task, short enough for a core's cache.
constexpr size_t kPixelChunk = 4096;

// Calls task(body, i) for all i < count. Every loop below goes through it: the thread library is known to one file.
void parallelTasks(size_t count, const void* body, void (*task)(const void* body, size_t index));

// Starts the threads, which otherwise start with the first loop: they would wait for a module that is being opened.
void startThreads();

// Calls body(i) for all i < count, in any order on any thread; the first exception that is thrown ends it.
template <class Body>
void parallelFor(size_t count, const Body& body) {
  parallelTasks(count, &body, [](const void* b, size_t i) { (*static_cast<const Body*>(b))(i); });
}

// Calls body(begin, end) for consecutive chunks of `chunk` items of [0, count).
template <class Body>
void parallelChunks(size_t count, size_t chunk, const Body& body) {
  parallelFor((count + chunk - 1) / chunk, [&](size_t c) { body(c * chunk, std::min(count, (c + 1) * chunk)); });
}

// Calls body(y) for every row of an image.
template <class Body>
void parallelRows(int height, const Body& body) {
  parallelFor(static_cast<size_t>(std::max(0, height)), [&](size_t y) { body(static_cast<int>(y)); });
}

// Sums map(begin, end) over fixed chunks, added in chunk order: the same bits for any number of threads.
template <class T, class Map>
T parallelSum(size_t count, size_t chunk, T zero, const Map& map) {
  std::vector<T> partial((count + chunk - 1) / chunk, zero);
  parallelFor(partial.size(), [&](size_t c) { partial[c] = map(c * chunk, std::min(count, (c + 1) * chunk)); });
  T total = zero;
  for (const T& p : partial) total += p;
  return total;
}

// Both at once.
void parallelBoth(const std::function<void()>& one, const std::function<void()>& other);

// Runs the task, and the loops in it, on at most so many threads; 0: as many as the machine has.
void withThreads(int threads, const std::function<void()>& task);

// Runs the task; soon after `cancel` is set, all loops in it skip what is left of them, so that it ends as early as the
// code between its loops lets it. What it makes is worth nothing then. Null: it cannot be cancelled.
void cancellable(const std::atomic<bool>* cancel, const std::function<void()>& task);

// Threads that the machine runs at once.
int machineThreads();

}  // namespace braid
