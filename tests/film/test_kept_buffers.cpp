// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/kept_buffers.h"

#include <doctest/doctest.h>

namespace braid::test_kept_buffers {

TEST_CASE("Buffers for two readers are those of either, and stops rise, each once") {
  KeptBuffers kept{.features = true, .stops = {8, 64}};
  kept |= {.featureNoise = true, .quarters = true, .stops = {2, 8, 512}};
  CHECK(kept == KeptBuffers{.features = true, .featureNoise = true, .quarters = true, .stops = {2, 8, 64, 512}});
  kept |= KeptBuffers{};
  CHECK(kept.stops.size() == 4);
  KeptBuffers all = KeptBuffers::everything();
  all |= kept;
  CHECK(all.history);
  CHECK(all.directIndirect);
}

}  // namespace braid::test_kept_buffers
