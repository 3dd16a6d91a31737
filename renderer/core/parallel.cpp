// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/parallel.h"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#ifdef __SANITIZE_THREAD__
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#endif

namespace braid {

namespace {

// ThreadSanitizer cannot see how oneTBB, which is built without it, hands over what one task wrote to those that wait
// for it. These say so: what was released at an address happened before what acquires it.
inline void released([[maybe_unused]] const void* address) {
#ifdef __SANITIZE_THREAD__
  __tsan_release(const_cast<void*>(address));
#endif
}
inline void acquired([[maybe_unused]] const void* address) {
#ifdef __SANITIZE_THREAD__
  __tsan_acquire(const_cast<void*>(address));
#endif
}

}  // namespace

void parallelTasks(size_t count, const void* body, void (*task)(const void* body, size_t index)) {
  const char begin = 0, end = 0;
  released(&begin);
  tbb::parallel_for(size_t(0), count, [&](size_t i) {
    acquired(&begin);
    task(body, i);
    released(&end);
  });
  acquired(&end);
}

void parallelBoth(const std::function<void()>& one, const std::function<void()>& other) {
  const char begin = 0, end = 0;
  released(&begin);
  const auto run = [&](const std::function<void()>& task) {
    acquired(&begin);
    task();
    released(&end);
  };
  tbb::parallel_invoke([&] { run(one); }, [&] { run(other); });
  acquired(&end);
}

void withThreads(int threads, const std::function<void()>& task) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute(task);
}

namespace {

// Looks at a flag every few milliseconds, on a thread of its own, and cancels a context once it is set.
class CancelWatch {
 public:
  CancelWatch(const std::atomic<bool>& cancel, tbb::task_group_context& context)
      : thread_([this, &cancel, &context] {
          std::unique_lock lock(mutex_);
          while (!wake_.wait_for(lock, std::chrono::milliseconds(5), [this] { return over_; }))
            if (cancel.load()) context.cancel_group_execution();
        }) {}
  ~CancelWatch() {
    {
      const std::lock_guard lock(mutex_);
      over_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace

void cancellable(const std::atomic<bool>* cancel, const std::function<void()>& task) {
  if (!cancel) return task();
  // The context of loops inside of a task is that of the task.
  tbb::task_group_context context;
  const CancelWatch watch(*cancel, context);
  tbb::parallel_for(
      0, 1, [&](int) { task(); }, context);
}

int machineThreads() { return tbb::info::default_concurrency(); }

}  // namespace braid
