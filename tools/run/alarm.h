// SPDX-License-Identifier: Apache-2.0
// Something that happens when the time is up, unless what it waits for is over by then.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace braid {

class Alarm {
 public:
  // Calls `ring`, on a thread of its own, after so many seconds.
  Alarm(double seconds, std::function<void()> ring)
      : thread_([this, seconds, ring = std::move(ring)] {
          std::unique_lock lock(mutex_);
          const auto time = std::chrono::duration<double>(std::clamp(seconds, 0.0, 1e9));
          if (!wake_.wait_for(lock, time, [this] { return over_; })) ring();
        }) {}
  // It does not ring from here on; waits for one that is ringing.
  ~Alarm() {
    {
      const std::lock_guard lock(mutex_);
      over_ = true;
    }
    wake_.notify_one();
    thread_.join();
  }
  Alarm(const Alarm&) = delete;
  Alarm& operator=(const Alarm&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace braid
