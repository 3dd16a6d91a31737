// SPDX-License-Identifier: Apache-2.0
// What fuzzing found, once mended, stays mended: every file in tests/fuzz/found/TARGET.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/fuzz/targets.h"

namespace braid::test_fuzz_findings {

TEST_CASE("inputs that fuzzing found") {
  const std::filesystem::path found = BRAID_SOURCE_DIR "/tests/fuzz/found";
  size_t inputs = 0;
  for (const fuzz::Target& target : fuzz::targets()) {
    if (!std::filesystem::exists(found / target.name)) continue;
    for (const auto& entry : std::filesystem::directory_iterator(found / target.name)) {
      std::ifstream in(entry.path(), std::ios::binary);
      const std::vector<uint8_t> bytes{std::istreambuf_iterator<char>(in), {}};
      INFO(entry.path().string());
      CHECK_NOTHROW(target.run(bytes));
      ++inputs;
    }
  }
  CHECK(inputs > 0);
}

}  // namespace braid::test_fuzz_findings
