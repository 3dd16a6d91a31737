// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/tile_plan.h"

#include <algorithm>
#include <numeric>

#include "renderer/core/error.h"

namespace braid {

namespace {

void include(TileRegion& region, const TileRegion& more) {
  if (region.x1 == region.x0) {
    region = more;
    return;
  }
  region = {std::min(region.x0, more.x0), std::min(region.y0, more.y0), std::max(region.x1, more.x1),
            std::max(region.y1, more.y1)};
}

TileRegion clipped(const TileRegion& r, const TileRegion& image) {
  return {std::max(r.x0, image.x0), std::max(r.y0, image.y0), std::min(r.x1, image.x1), std::min(r.y1, image.y1)};
}

TileRegion atLevel(const TileRegion& image, int level) { return {0, 0, image.x1 >> level, image.y1 >> level}; }

// What a layer reads for a region of what it makes.
TileRegion needed(const NetworkLayer& layer, const TileRegion& out, const TileRegion& image) {
  switch (layer.kind) {
    case LayerKind::Convolution: {
      const int r = layer.kernel / 2;
      return clipped({out.x0 - r, out.y0 - r, out.x1 + r, out.y1 + r}, image);
    }
    case LayerKind::MaxPool:
      return {2 * out.x0, 2 * out.y0, 2 * out.x1, 2 * out.y1};
    case LayerKind::Upsample:
      return {out.x0 / 2, out.y0 / 2, (out.x1 + 1) / 2, (out.y1 + 1) / 2};
    default:
      return out;
  }
}

// What a convolution makes of a region: more than what is needed where its input is read by others as well.
TileRegion convolved(const TileRegion& in, const TileRegion& image, int kernel, ConvolutionSize& size) {
  const int r = kernel / 2;
  const auto zeros = [r](bool border) { return border ? r : 0; };
  size = {in.width(),
          in.height(),
          zeros(in.x0 == image.x0),
          zeros(in.y0 == image.y0),
          zeros(in.x1 == image.x1),
          zeros(in.y1 == image.y1)};
  return {in.x0 + r - size.left, in.y0 + r - size.top, in.x1 - r + size.right, in.y1 - r + size.bottom};
}

void findRegions(const Network& network, const NetworkGraph& graph, const TileRegion& tile, const TileRegion& image,
                 TilePlan& plan) {
  const size_t layers = network.layers.size();
  plan.tensors.back().region = tile;
  for (size_t l = layers; l-- > 0;)
    for (const size_t in : graph.inputs[l]) {
      const TileRegion& out = plan.tensors[l + 1].region;
      if (out.pixels() == 0) continue;  // nothing reads it
      include(plan.tensors[in].region, needed(network.layers[l], out, atLevel(image, graph.tensors[in].level)));
    }
  plan.sizes.resize(layers);
  for (size_t l = 0; l < layers; ++l) {
    if (network.layers[l].kind != LayerKind::Convolution || plan.tensors[l + 1].region.pixels() == 0) continue;
    const size_t in = graph.inputs[l][0];
    plan.tensors[l + 1].region = convolved(plan.tensors[in].region, atLevel(image, graph.tensors[in].level),
                                           network.layers[l].kernel, plan.sizes[l]);
  }
}

// After which layer a tensor is read no more; the output is kept.
std::vector<size_t> lastReads(const NetworkGraph& graph) {
  std::vector<size_t> last(graph.tensors.size(), 0);
  for (size_t t = 1; t < last.size(); ++t) last[t] = t - 1;
  for (size_t l = 0; l < graph.inputs.size(); ++l)
    for (const size_t in : graph.inputs[l]) last[graph.joined[in] ? graph.inputs[in - 1][0] : in] = l;
  last.back() = graph.inputs.size();
  return last;
}

// The largest first, each gets the lowest place that none of those before it takes in its time.
void placeTensors(const NetworkGraph& graph, TilePlan& plan) {
  const std::vector<size_t> last = lastReads(graph);
  std::vector<size_t> order(plan.tensors.size()), placed;  // `placed` by their places
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return plan.tensors[a].values > plan.tensors[b].values; });
  // Tensor t is made by layer t - 1.
  const auto meet = [&](size_t a, size_t b) { return a <= last[b] + 1 && b <= last[a] + 1; };
  for (const size_t t : order) {
    TilePlan::Tensor& tensor = plan.tensors[t];
    if (tensor.values == 0) continue;
    for (const size_t other : placed) {
      if (!meet(t, other)) continue;
      if (tensor.offset + tensor.values <= plan.tensors[other].offset) break;
      tensor.offset = std::max(tensor.offset, plan.tensors[other].offset + plan.tensors[other].values);
    }
    const auto after = std::find_if(placed.begin(), placed.end(),
                                    [&](size_t other) { return plan.tensors[other].offset > tensor.offset; });
    placed.insert(after, t);
    plan.values = std::max(plan.values, tensor.offset + tensor.values);
  }
}

}  // namespace

std::vector<std::vector<int>> channelSlots(const Network& network, const NetworkGraph& graph, int block) {
  std::vector<std::vector<int>> slots(graph.tensors.size());
  const auto inOrder = [](int channels) {
    std::vector<int> list(static_cast<size_t>(channels));
    for (int c = 0; c < channels; ++c) list[static_cast<size_t>(c)] = c;
    return list;
  };
  slots[0] = inOrder(network.inputs);
  for (size_t l = 0; l < network.layers.size(); ++l) {
    if (network.layers[l].kind == LayerKind::Convolution) {
      slots[l + 1] = inOrder(network.layers[l].outputs);
      continue;
    }
    int before = 0;
    for (const size_t in : graph.inputs[l]) {
      for (const int slot : slots[in]) slots[l + 1].push_back(before + slot);
      before = (slots[l + 1].back() + block) / block * block;
    }
  }
  return slots;
}

TilePlan planTile(const Network& network, const NetworkGraph& graph, const TileRegion& tile, const TileRegion& image,
                  int block) {
  TilePlan plan;
  plan.tensors.resize(graph.tensors.size());
  findRegions(network, graph, tile, image, plan);
  const std::vector<std::vector<int>> slots = channelSlots(network, graph, block);
  for (size_t t = 0; t < plan.tensors.size(); ++t) {
    TilePlan::Tensor& tensor = plan.tensors[t];
    tensor.blocks = slots[t].back() / block + 1;
    if (!graph.joined[t]) tensor.values = tensor.region.pixels() * static_cast<size_t>(tensor.blocks * block);
  }
  placeTensors(graph, plan);
  return plan;
}

}  // namespace braid
