// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/parallel.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

namespace braid {

void parallelTasks(size_t count, const void* body, void (*task)(const void* body, size_t index)) {
  tbb::parallel_for(size_t(0), count, [=](size_t i) { task(body, i); });
}

void parallelBoth(const std::function<void()>& one, const std::function<void()>& other) {
  tbb::parallel_invoke(one, other);
}

void withThreads(int threads, const std::function<void()>& task) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute(task);
}

int machineThreads() { return tbb::info::default_concurrency(); }

}  // namespace braid
