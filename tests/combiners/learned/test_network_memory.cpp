// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include "combiners/denoise/oidn/oidn.h"
#include "combiners/denoise/oidn/oidn_unet.h"
#include "combiners/learned/tiled_network.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/method_names.h"
#include "renderer/core/parallel.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/counted_memory.h"
#include "tests/support/gltf_fixture.h"
#include "tests/combiners/learned/plain_network.h"

namespace braid::test_network_memory {

using namespace test;

namespace {

// Of what is stated for a thread, what processors without AVX-512 leave: there the library takes no scratch.
double leftScratch() { return oneDnn()->block() < 16 ? static_cast<double>(kConvolutionScratch) : 0; }
// And its blocks of 8 channels hold fewer zeros than those of 16.
double leftOfTiles() { return oneDnn()->block() < 16 ? static_cast<double>(kTileBytes) / 16 : 0; }

}  // namespace

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
    CHECK(peak > 0.9 * (each - leftScratch()));
    CHECK(peak < 1.1 * threads * each);
  }
  CHECK(tiled.threadBytes(8192, 8192) < (size_t(32) << 20) + kConvolutionScratch);
  CHECK(tiled.threadBytes(8192, 8192) > 0.9 * (32 << 20));
  CHECK(tiled.threadBytes(1, 1) < kConvolutionScratch + (1 << 20));
}

TEST_CASE("oidn takes no more memory than it states, and not much less where images are larger than its tiles") {
  if (!oneDnn()) return;
  const Folder folder;
  writeTza((folder.path / "rt_hdr.tza").string(), randomUnet(3, 32, false));
  const int side = TiledNetwork(oidnUnet(randomUnet(3, 32, false)), *oneDnn()).tileSide();
  const auto method = makeOidn(nullptr, "", {folder.path.string(), true});
  Estimate e;
  e.mean = Rgb<float>(3 * side, 2 * side);
  for (Plane<float>& plane : e.mean.channel) std::fill(plane.data.begin(), plane.data.end(), 0.5f);
  e.half[0] = e.half[1] = e.mean;
  MethodInputs in;
  in.unbiased = &e;
  const MethodMemory stated = method->memory({});
  const auto pixels = static_cast<double>(e.mean.size()), each = static_cast<double>(stated.eachThread);
  for (const int threads : {1, 2}) {
    const int64_t before = heapBytes();
    resetHeapPeak();
    MethodResult result;
    withThreads(threads, [&] { result = method->run(in); });
    const auto peak = static_cast<double>(heapPeak() - before);
    INFO(threads, " threads: ", peak / (pixels * stated.peak + threads * each));
    CHECK(peak < 1.1 * (pixels * stated.peak + threads * each));
    // Every tile of this image is at its border, and the heap of oneDNN, which holds the weights, is not counted.
    CHECK(peak > 0.8 * (pixels * stated.peak + each));
    CHECK(static_cast<double>(heapBytes() - before) == doctest::Approx(pixels * stated.kept).epsilon(0.1));
  }
}

TEST_CASE("Methods with networks of their own take no more memory than they state") {
  const Case c = makeCase(sized(1000, 600, 4));
  for (const char* name : {"kpn", "js-neural", "double-shrinkage-neural"}) {
    const std::shared_ptr<const Method> method = findMethod(name);
    if (!oneDnn() || !dynamic_cast<const ExternalMethod&>(*method).skipReason().empty()) return;
    const MethodInputs in = inputsOf(c);
    const auto pixels = static_cast<double>(c.pt().mean.size());
    MemoryCase of;
    of.passes = 4;
    of.photonMap = method->needs().biased;
    const MethodMemory stated = method->memory(of);
    const auto each = static_cast<double>(stated.eachThread);
    for (const int threads : {1, 2}) {
      const int64_t before = heapBytes();
      resetHeapPeak();
      MethodResult result;
      withThreads(threads, [&] { result = method->run(in); });
      const auto peak = static_cast<double>(heapPeak() - before);
      INFO(method->name(), " on ", threads, " threads: ", (peak - each) / pixels, " bytes a pixel");
      CHECK(peak < 1.1 * (pixels * stated.peak + threads * each));
      CHECK(peak > 0.7 * (pixels * stated.peak + each - leftScratch() - leftOfTiles()));
      CHECK(static_cast<double>(heapBytes() - before) == doctest::Approx(pixels * stated.kept).epsilon(0.1));
    }
  }
}

}  // namespace braid::test_network_memory
