// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include "combiners/denoise/oidn/oidn_unet.h"
#include "combiners/learned/tiled_network.h"
#include "renderer/core/parallel.h"
#include "tests/support/counted_memory.h"
#include "tests/support/plain_network.h"

namespace braid::test_network_memory {

using namespace test;

TEST_CASE("A network takes the memory that it says, whatever the image") {
  const ConvolutionLibrary* library = oneDnn();
  if (!library) return;
  TiledNetwork tiled(oidnUnet(randomUnet(9, 32, false)), *library, size_t(32) << 20);
  const Planar image = randomPlanar(9, 3 * tiled.tileSide(), 2 * tiled.tileSide());
  run(tiled, image, 3);  // prepares what all runs share
  Planar out(3, image.width, image.height);
  for (const int threads : {1, 2}) {
    const int64_t before = heapBytes();
    resetHeapPeak();
    withThreads(threads, [&] { run(tiled, image, 3); });
    const double peak = static_cast<double>(heapPeak() - before) - static_cast<double>(out.values.size() * 4);
    const auto each = static_cast<double>(tiled.threadBytes(image.width, image.height));
    INFO(threads, " threads: ", peak / each);
    CHECK(peak > 0.9 * each);
    CHECK(peak < 1.1 * threads * each);
  }
  CHECK(tiled.threadBytes(8192, 8192) < (size_t(32) << 20) + kConvolutionScratch);
  CHECK(tiled.threadBytes(8192, 8192) > 0.9 * (32 << 20));
  CHECK(tiled.threadBytes(1, 1) < kConvolutionScratch + (1 << 20));
}

}  // namespace braid::test_network_memory
