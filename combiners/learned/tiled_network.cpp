// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/tiled_network.h"

#include <algorithm>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/pixel_buffer.h"

namespace braid {

namespace {

int roundedUp(int value, int multiple) { return (value + multiple - 1) / multiple * multiple; }

// In the middle of an image that reaches beyond all that it needs.
size_t innerTileBytes(const Network& network, const NetworkGraph& graph, int block, int side) {
  const int around = 64 << graph.levels;
  const TileRegion image{0, 0, side + 2 * around, side + 2 * around};
  return planTile(network, graph, {around, around, around + side, around + side}, image, block).values * sizeof(float);
}

// The weights of a convolution for whole blocks of channels; those that the network does not have get zeros.
ConvolutionWeights blockedWeights(const NetworkLayer& layer, const std::vector<int>& inSlots, int block) {
  ConvolutionWeights w;
  w.inputs = roundedUp(inSlots.back() + 1, block);
  w.outputs = roundedUp(layer.outputs, block);
  w.kernel = layer.kernel;
  w.relu = layer.relu;
  w.bias = layer.bias;
  w.bias.resize(static_cast<size_t>(w.outputs), 0.0f);
  const auto taps = static_cast<size_t>(layer.kernel * layer.kernel), inputs = inSlots.size();
  w.weights.assign(static_cast<size_t>(w.outputs) * static_cast<size_t>(w.inputs) * taps, 0.0f);
  for (size_t o = 0; o < static_cast<size_t>(layer.outputs); ++o)
    for (size_t i = 0; i < inputs; ++i)
      std::copy_n(
          layer.weights.begin() + static_cast<std::ptrdiff_t>((o * inputs + i) * taps), taps,
          w.weights.begin() + static_cast<std::ptrdiff_t>(
                                  (o * static_cast<size_t>(w.inputs) + static_cast<size_t>(inSlots[i])) * taps));
  return w;
}

}  // namespace

int tileSideWithin(const Network& network, const NetworkGraph& graph, int block, size_t tileBytes) {
  const int step = std::max(16, 1 << graph.levels);
  int side = step;
  while (side < 2048 && innerTileBytes(network, graph, block, side + step) <= tileBytes) side += step;
  return side;
}

TiledNetwork::TiledNetwork(Network network, const ConvolutionLibrary& library, size_t tileBytes)
    : network_(std::move(network)),
      graph_(graphOf(network_)),
      block_(library.block()),
      side_(tileSideWithin(network_, graph_, block_, tileBytes)),
      layers_(network_.layers.size()) {
  const std::vector<std::vector<int>> slots = channelSlots(network_, graph_, block_);
  for (size_t l = 0; l < layers_.size(); ++l) {
    NetworkLayer& layer = network_.layers[l];
    if (layer.kind != LayerKind::Convolution) continue;
    std::string error;
    layers_[l].convolution = library.layer(blockedWeights(layer, slots[graph_.inputs[l][0]], block_), error);
    if (!layers_[l].convolution) throw Error(ExitCode::Internal, fmt::format("layer {}: {}", layer.name, error));
    layer.weights = {};
  }
}

TileRegion TiledNetwork::padded(int width, int height) const {
  const int multiple = 1 << graph_.levels;
  return {0, 0, roundedUp(width, multiple), roundedUp(height, multiple)};
}

// As few as there can be, and of about the same size.
std::vector<TileRegion> TiledNetwork::tiles(const TileRegion& image) const {
  const int multiple = 1 << graph_.levels;
  const auto side = [&](int size) {
    const int count = (size + side_ - 1) / side_;
    return roundedUp((size + count - 1) / count, multiple);
  };
  const int width = side(image.x1), height = side(image.y1);
  std::vector<TileRegion> list;
  for (int y = 0; y < image.y1; y += height)
    for (int x = 0; x < image.x1; x += width)
      list.push_back({x, y, std::min(image.x1, x + width), std::min(image.y1, y + height)});
  return list;
}

TilePlan TiledNetwork::plan(const TileRegion& tile, const TileRegion& image) const {
  return planTile(network_, graph_, tile, image, block_);
}

size_t TiledNetwork::threadBytes(int width, int height) const {
  const TileRegion image = padded(width, height);
  size_t values = 0;
  for (const TileRegion& tile : tiles(image)) values = std::max(values, plan(tile, image).values);
  return values * sizeof(float) + kConvolutionScratch;
}

size_t TiledNetwork::sharedBytes() const {
  size_t bytes = 0;
  for (const Layer& layer : layers_)
    if (layer.convolution) bytes += layer.convolution->bytes();
  return bytes;
}

void TiledNetwork::run(const NetworkImage& image) {
  const TileRegion all = padded(image.width, image.height);
  const std::vector<TileRegion> list = tiles(all);
  parallelFor(list.size(), [&](size_t i) { runTile(list[i], all, image); });
}

const Convolution& TiledNetwork::prepared(size_t layer, const ConvolutionSize& size) {
  const std::lock_guard lock(mutex_);
  std::unique_ptr<Convolution>& convolution = layers_[layer].prepared[size];
  std::string error;
  if (!convolution) convolution = layers_[layer].convolution->prepare(size, error);
  if (!convolution)
    throw Error(ExitCode::Internal, fmt::format("layer {} of {}x{} pixels: {}", network_.layers[layer].name, size.width,
                                                size.height, error));
  return *convolution;
}

void TiledNetwork::runTile(const TileRegion& tile, const TileRegion& all, const NetworkImage& image) {
  const auto cancelled = [&] { return image.cancel && image.cancel->load(); };
  const TilePlan planned = plan(tile, all);
  PixelBuffer<float> memory(planned.values, kUnfilled);
  const auto tensor = [&](size_t t) {
    const TilePlan::Tensor& placed = planned.tensors[t];
    return BlockedTensor{memory.data() + placed.offset, placed.region, placed.blocks, block_};
  };
  readInput(tensor(0), image);
  for (size_t l = 0; l < layers_.size() && !cancelled(); ++l) runLayer(l, planned, memory.data());
  if (!cancelled()) writeOutput(tensor(planned.tensors.size() - 1), tile, image);
}

void TiledNetwork::runLayer(size_t l, const TilePlan& planned, float* memory) {
  const auto tensor = [&](size_t t) {
    const TilePlan::Tensor& placed = planned.tensors[t];
    return BlockedTensor{memory + placed.offset, placed.region, placed.blocks, block_};
  };
  const NetworkLayer& layer = network_.layers[l];
  const BlockedTensor in = tensor(graph_.inputs[l][0]), out = tensor(l + 1);
  switch (layer.kind) {
    case LayerKind::Convolution: {
      if (out.region.pixels() == 0) break;
      const Convolution& convolution = prepared(l, planned.sizes[l]);
      PixelBuffer<float> scratch(convolution.scratchValues(), kUnfilled);
      if (!convolution.run(in.values, out.values, scratch.data()))
        throw Error(ExitCode::Internal, fmt::format("layer {}: the library of convolutions failed", layer.name));
      break;
    }
    case LayerKind::MaxPool:
      maxPool(in, out);
      break;
    case LayerKind::Upsample:
      if (!graph_.joined[l + 1]) upsample(in, out, 0);
      break;
    case LayerKind::Concatenate:
      int first = 0;
      for (const size_t t : graph_.inputs[l]) {
        if (graph_.joined[t])
          upsample(tensor(graph_.inputs[t - 1][0]), out, first);
        else
          copyBlocks(tensor(t), out, first);
        first += planned.tensors[t].blocks;
      }
      break;
  }
}

void TiledNetwork::readInput(const BlockedTensor& input, const NetworkImage& image) const {
  const TileRegion& r = input.region;
  const auto channels = static_cast<size_t>(network_.inputs), width = static_cast<size_t>(r.width());
  std::vector<float> row(width * channels);
  // Tiles begin within the image: only their ends lie beyond it.
  const int end = std::min(r.x1, image.width);
  for (int y = r.y0; y < r.y1; ++y) {
    std::fill(row.begin(), row.end(), 0.0f);
    if (y < image.height) image.read(y, r.x0, end, row.data());
    setRow(input, y, row.data(), network_.inputs);
  }
}

void TiledNetwork::writeOutput(const BlockedTensor& output, const TileRegion& tile, const NetworkImage& image) const {
  const int end = std::min(tile.x1, image.width), channels = graph_.tensors.back().channels;
  std::vector<float> row(static_cast<size_t>(end - tile.x0) * static_cast<size_t>(channels));
  for (int y = tile.y0; y < std::min(tile.y1, image.height); ++y) {
    getRow(output, y, tile.x0, end, row.data(), channels);
    image.write(y, tile.x0, end, row.data());
  }
}

}  // namespace braid
