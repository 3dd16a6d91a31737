// SPDX-License-Identifier: Apache-2.0
// Networks run tile by tile are networks run on the whole image, for any number of threads.
#include <doctest/doctest.h>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "combiners/denoise/oidn/oidn_unet.h"
#include "combiners/learned/tiled_network.h"
#include "renderer/core/error.h"
#include "tests/combiners/learned/plain_network.h"

namespace braid::test_networks {

using namespace test;

namespace {

const PlainConvolutions kPlain;

NetworkLayer layerOf(const std::string& name, LayerKind kind, const std::vector<std::string>& inputs) {
  NetworkLayer layer;
  layer.name = name;
  layer.kind = kind;
  layer.inputs = inputs;
  return layer;
}

NetworkLayer convolution(const std::string& name, const std::string& in, int inputs, int outputs, int kernel) {
  NetworkLayer layer = layerOf(name, LayerKind::Convolution, {in});
  layer.outputs = outputs;
  layer.kernel = kernel;
  layer.weights = randomWeights(outputs, inputs, kernel, name.size()).values;
  layer.bias.assign(static_cast<size_t>(outputs), 0.1f);
  return layer;
}

// All that the engine has and U-Nets have not: 1x1 pixels, no ReLU, an upsampled image that a convolution reads, inputs
// that are read at two distances, and a layer that nothing reads.
Network oddNetwork() {
  Network n;
  n.inputs = 5;
  n.layers.push_back(convolution("wide", kNetworkInput, 5, 6, 3));
  n.layers.push_back(convolution("point", "wide", 6, 7, 1));
  n.layers.back().relu = false;
  n.layers.push_back(layerOf("half", LayerKind::MaxPool, {"wide"}));
  n.layers.push_back(convolution("deep", "half", 6, 5, 3));
  n.layers.push_back(layerOf("quarter", LayerKind::MaxPool, {"deep"}));
  n.layers.push_back(layerOf("lost", LayerKind::Upsample, {"quarter"}));
  n.layers.push_back(layerOf("back", LayerKind::Upsample, {"deep"}));
  n.layers.push_back(convolution("smooth", "back", 5, 2, 3));
  n.layers.push_back(layerOf("all", LayerKind::Concatenate, {"smooth", "point", "back", kNetworkInput}));
  n.layers.push_back(convolution("out", "all", 19, 2, 3));
  n.layers.back().relu = false;
  return n;
}

}  // namespace

TEST_CASE("Tiles hold exactly what the whole image gives them") {
  for (const bool large : {false, true}) {
    const Network network = oidnUnet(randomUnet(5, 4, large));
    const Planar image = randomPlanar(5, 101, 58);
    TiledNetwork whole(network, kPlain, size_t(1) << 40), tiled(network, kPlain, size_t(1) << 19);
    CHECK(whole.tileSide() > 101);
    CHECK(tiled.tileSide() < 50);
    const Planar a = run(whole, image, 3), b = run(tiled, image, 3);
    CHECK(a.values == b.values);
    CHECK(largestDifference(a, plainNetwork(network, image, 16)) < 1e-5);
  }
}

TEST_CASE("Any graph of layers, sizes from one pixel on") {
  const Network network = oddNetwork();
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{{1, 1}, {3, 1}, {1, 40}, {17, 9}, {70, 50}}) {
    const Planar image = randomPlanar(5, width, height);
    const Planar expected = plainNetwork(network, image, 4);
    for (const size_t bytes : {size_t(1), size_t(1) << 30}) {
      TiledNetwork tiled(network, kPlain, bytes);
      CHECK(largestDifference(run(tiled, image, 2), expected) < 1e-5);
    }
    if (const ConvolutionLibrary* library = oneDnn()) {
      TiledNetwork tiled(network, *library, 1);
      CHECK(largestDifference(run(tiled, image, 2), expected) < 1e-5);
    }
  }
}

TEST_CASE("By oneDNN a network gives what nested loops give, without seams, in the same bits on any threads") {
  const ConvolutionLibrary* library = oneDnn();
  if (!library) return;
  const Network network = oidnUnet(randomUnet(9, 33, false));
  const Planar image = randomPlanar(9, 110, 70);
  const Planar expected = plainNetwork(network, image, 16);
  TiledNetwork tiled(network, *library, size_t(6) << 20);
  CHECK(tiled.tileSide() < 70);
  std::vector<Planar> results;
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  for (const int threads : {1, 2, 5})
    tbb::task_arena(threads).execute([&] { results.push_back(run(tiled, image, 3)); });
  CHECK(largestDifference(results[0], expected) < 2e-5);
  CHECK(results[0].values == results[1].values);
  CHECK(results[0].values == results[2].values);
}

TEST_CASE("A network that is told to end ends") {
  TiledNetwork tiled(oddNetwork(), kPlain, 1);
  std::atomic<bool> cancel{true};
  int rows = 0;
  NetworkImage image;
  image.width = image.height = 32;
  image.read = [](int, int x0, int x1, float* row) { std::fill_n(row, 5 * (x1 - x0), 1.0f); };
  image.write = [&](int, int, int, const float*) { ++rows; };
  image.cancel = &cancel;
  tiled.run(image);
  CHECK(rows == 0);
}

TEST_CASE("A graph that is none is refused with the name of its layer") {
  const auto refused = [](const auto& change, const char* text) {
    Network network = oddNetwork();
    change(network);
    CHECK_THROWS_WITH_AS(graphOf(network), doctest::Contains(text), Error);
  };
  CHECK_NOTHROW(graphOf(oddNetwork()));
  refused([](Network& n) { n.layers.clear(); }, "without inputs or without layers");
  refused([](Network& n) { n.layers[1].inputs = {"nobody"}; }, "layer point: it reads nobody");
  refused([](Network& n) { n.layers[1].inputs.clear(); }, "layer point: 0 inputs");
  refused([](Network& n) { n.layers[1].name = "wide"; }, "layer wide: a second one");
  refused([](Network& n) { n.layers[0].weights.pop_back(); }, "layer wide: 269 weights, but 5 to 6 channels take 270");
  refused([](Network& n) { n.layers[0].bias.clear(); }, "layer wide: 0 biases for 6 channels");
  refused([](Network& n) { n.layers[0].kernel = 5; }, "5x5");
  refused([](Network& n) { n.layers[0].outputs = 1 << 30; }, "channels instead of 1 to");
  refused([](Network& n) { n.layers[8].inputs = {"smooth", "half"}; }, "layer all: its inputs have different");
  refused([](Network& n) { n.layers.resize(3); }, "layer half: the output has fewer pixels");
  refused([](Network& n) { n.layers[6].inputs = {"wide"}; }, "more pixels than the image");
}

}  // namespace braid::test_networks
