// SPDX-License-Identifier: Apache-2.0
// The program that clang's libFuzzer drives; BRAID_FUZZ_TARGET says with which target.
#include <cstdlib>
#include <string>

#include <fmt/format.h>

#include "tests/fuzz/targets.h"

namespace {

braid::fuzz::Target chosen() {
  const char* wanted = std::getenv("BRAID_FUZZ_TARGET");
  for (const braid::fuzz::Target& target : braid::fuzz::targets())
    if (wanted && std::string(wanted) == target.name) return target;
  fmt::print(stderr, "BRAID_FUZZ_TARGET must be one of:");
  for (const braid::fuzz::Target& target : braid::fuzz::targets()) fmt::print(stderr, " {}", target.name);
  fmt::print(stderr, "\n");
  std::exit(1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t bytes) {
  static const braid::fuzz::Target target = chosen();
  target.run({data, bytes});
  return 0;
}
