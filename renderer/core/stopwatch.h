// SPDX-License-Identifier: Apache-2.0
// Wall-clock seconds since it was made or restarted.
#pragma once

#include <chrono>

namespace braid {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }
  void restart() { start_ = std::chrono::steady_clock::now(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace braid
