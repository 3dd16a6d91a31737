// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/network.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

// Beyond these lies an error rather than a network: memory goes with the square of the one and the power of the other.
constexpr int kMostChannels = 4096, kMostLevels = 8;

[[noreturn]] void fail(const NetworkLayer& layer, const std::string& reason) {
  throw Error(ExitCode::BadInput, fmt::format("layer {}: {}", layer.name, reason));
}

NetworkGraph::Tensor convolved(const NetworkLayer& layer, const NetworkGraph::Tensor& in) {
  if (layer.kernel != 1 && layer.kernel != 3)
    fail(layer, fmt::format("its kernel is {0}x{0} pixels, but only 1x1 and 3x3 are known", layer.kernel));
  if (layer.outputs < 1 || layer.outputs > kMostChannels)
    fail(layer, fmt::format("{} channels instead of 1 to {}", layer.outputs, kMostChannels));
  const size_t weights = static_cast<size_t>(layer.outputs) * static_cast<size_t>(in.channels) *
                         static_cast<size_t>(layer.kernel * layer.kernel);
  if (layer.weights.size() != weights)
    fail(layer, fmt::format("{} weights, but {} to {} channels take {}", layer.weights.size(), in.channels,
                            layer.outputs, weights));
  if (layer.bias.size() != static_cast<size_t>(layer.outputs))
    fail(layer, fmt::format("{} biases for {} channels", layer.bias.size(), layer.outputs));
  return {layer.outputs, in.level};
}

NetworkGraph::Tensor madeBy(const NetworkLayer& layer, const std::vector<NetworkGraph::Tensor>& in) {
  if (in.empty() || (in.size() > 1 && layer.kind != LayerKind::Concatenate))
    fail(layer, fmt::format("{} inputs instead of one", in.size()));
  NetworkGraph::Tensor out = in[0];
  if (layer.kind == LayerKind::Convolution) return convolved(layer, out);
  if (layer.kind == LayerKind::MaxPool && ++out.level > kMostLevels)
    fail(layer, fmt::format("more than {} levels of pooling", kMostLevels));
  if (layer.kind == LayerKind::Upsample && --out.level < 0) fail(layer, "it would have more pixels than the image");
  for (size_t k = 1; k < in.size(); ++k) {
    if (in[k].level != out.level) fail(layer, "its inputs have different numbers of pixels");
    out.channels += in[k].channels;
  }
  if (out.channels > kMostChannels) fail(layer, fmt::format("{} channels, {} at most", out.channels, kMostChannels));
  return out;
}

void findJoined(const Network& network, NetworkGraph& graph) {
  graph.joined.assign(graph.tensors.size(), false);
  for (size_t l = 0; l + 1 < network.layers.size(); ++l)
    graph.joined[l + 1] = network.layers[l].kind == LayerKind::Upsample;
  for (size_t l = 0; l < network.layers.size(); ++l)
    for (const size_t in : graph.inputs[l])
      if (network.layers[l].kind != LayerKind::Concatenate) graph.joined[in] = false;
}

}  // namespace

NetworkGraph graphOf(const Network& network) {
  if (network.inputs < 1 || network.inputs > kMostChannels || network.layers.empty())
    throw Error(ExitCode::BadInput, "a network without inputs or without layers");
  NetworkGraph graph;
  graph.tensors.push_back({network.inputs, 0});
  std::map<std::string, size_t> numbers{{kNetworkInput, 0}};
  for (const NetworkLayer& layer : network.layers) {
    std::vector<size_t> inputs;
    std::vector<NetworkGraph::Tensor> read;
    for (const std::string& name : layer.inputs) {
      const auto found = numbers.find(name);
      if (found == numbers.end()) fail(layer, fmt::format("it reads {}, which no layer before it makes", name));
      inputs.push_back(found->second);
      read.push_back(graph.tensors[found->second]);
    }
    graph.tensors.push_back(madeBy(layer, read));
    graph.inputs.push_back(std::move(inputs));
    graph.levels = std::max(graph.levels, graph.tensors.back().level);
    if (!numbers.emplace(layer.name, graph.tensors.size() - 1).second) fail(layer, "a second one of this name");
  }
  if (graph.tensors.back().level != 0) fail(network.layers.back(), "the output has fewer pixels than the image");
  findJoined(network, graph);
  return graph;
}

}  // namespace braid
