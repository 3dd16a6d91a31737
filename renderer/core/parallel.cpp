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

// Looks at flags every few milliseconds, on a thread of its own, and cancels the contexts of those that are set. There
// is one until the process ends: threads that start would wait for a module that is being opened.
class CancelWatch {
 public:
  static CancelWatch& shared() {
    static CancelWatch& watch = *new CancelWatch;
    return watch;
  }

  void add(const std::atomic<bool>& cancel, tbb::task_group_context& context) {
    const std::lock_guard lock(mutex_);
    watched_.push_back({&cancel, &context});
    wake_.notify_one();
  }

  void remove(const tbb::task_group_context& context) {
    const std::lock_guard lock(mutex_);
    std::erase_if(watched_, [&](const Watched& w) { return w.context == &context; });
  }

 private:
  struct Watched {
    const std::atomic<bool>* cancel;
    tbb::task_group_context* context;
  };

  CancelWatch() {
    std::thread([this] { watch(); }).detach();
  }

  [[noreturn]] void watch() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return !watched_.empty(); });
      for (const Watched& w : watched_)
        if (w.cancel->load()) w.context->cancel_group_execution();
      lock.unlock();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      lock.lock();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<Watched> watched_;
};

// A context for as long as it is watched.
class Watching {
 public:
  explicit Watching(const std::atomic<bool>& cancel) { CancelWatch::shared().add(cancel, context); }
  ~Watching() { CancelWatch::shared().remove(context); }
  Watching(const Watching&) = delete;
  Watching& operator=(const Watching&) = delete;

  tbb::task_group_context context;
};

}  // namespace

void cancellable(const std::atomic<bool>* cancel, const std::function<void()>& task) {
  if (!cancel) return task();
  // The context of loops inside of a task is that of the task.
  Watching watching(*cancel);
  tbb::parallel_for(
      0, 1, [&](int) { task(); }, watching.context);
}

void startThreads() {
  CancelWatch::shared();
  parallelFor(4 * static_cast<size_t>(machineThreads()), [](size_t) {});
}

int machineThreads() { return tbb::info::default_concurrency(); }

}  // namespace braid
