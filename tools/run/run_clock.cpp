// SPDX-License-Identifier: Apache-2.0
#include "tools/run/run_clock.h"

#include <ctime>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <string>

#include "renderer/core/stopwatch.h"

namespace braid {

namespace {

// A process that is older than this when its program starts was something else before, such as a script that took its
// time and then became this program.
constexpr double kOldest = 2;

// How long ago the system started this process: field 22 of /proc/self/stat, in ticks since the machine started.
// Zero where that cannot be told.
double ageOfProcess() {
  std::ifstream file("/proc/self/stat");
  std::string text;
  std::getline(file, text);
  const size_t name = text.rfind(')');  // the second field may hold blanks
  if (name == std::string::npos) return 0;
  std::istringstream fields(text.substr(name + 1));
  std::string field;
  for (int i = 3; i < 22; ++i) fields >> field;
  unsigned long long ticks = 0;
  timespec now{};
  if (!(fields >> ticks) || clock_gettime(CLOCK_BOOTTIME, &now) != 0) return 0;
  const double started = static_cast<double>(ticks) / static_cast<double>(sysconf(_SC_CLK_TCK));
  const double age = static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - started;
  return age > 0 && age < kOldest ? age : 0;
}

struct Start {
  double before = ageOfProcess();
  Stopwatch clock;
};

// Before main(), so that `before` is only what loading the program took.
const Start start;

}  // namespace

double processSeconds() { return start.before + start.clock.seconds(); }

}  // namespace braid
