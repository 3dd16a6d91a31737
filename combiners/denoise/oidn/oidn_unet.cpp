// SPDX-License-Identifier: Apache-2.0
#include "combiners/denoise/oidn/oidn_unet.h"

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

class Builder {
 public:
  explicit Builder(WeightTensors weights) : weights_(std::move(weights)) {}

  // Each adds a layer and returns its name.
  std::string convolution(const std::string& name, const std::string& in);
  std::string convolutions(const std::string& name, const std::string& in) {
    return convolution(name + "b", convolution(name + "a", in));
  }
  std::string pool(const std::string& in) { return add(LayerKind::MaxPool, "pool_" + in, {in}); }
  // Up one level, beside what was there.
  std::string up(const std::string& in, const std::string& beside) {
    const std::string wide = add(LayerKind::Upsample, "up_" + in, {in});
    return add(LayerKind::Concatenate, "joined_" + in, {wide, beside});
  }

  Network network;

 private:
  std::string add(LayerKind kind, const std::string& name, const std::vector<std::string>& inputs) {
    NetworkLayer layer;
    layer.name = name;
    layer.kind = kind;
    layer.inputs = inputs;
    network.layers.push_back(std::move(layer));
    return name;
  }
  WeightTensor take(const std::string& name, size_t dimensions) {
    const auto found = weights_.find(name);
    if (found == weights_.end()) throw Error(ExitCode::BadInput, fmt::format("{} is missing", name));
    if (found->second.sizes.size() != dimensions)
      throw Error(ExitCode::BadInput,
                  fmt::format("{} has {} dimensions instead of {}", name, found->second.sizes.size(), dimensions));
    return std::move(found->second);
  }

  WeightTensors weights_;
};

std::string Builder::convolution(const std::string& name, const std::string& in) {
  WeightTensor weights = take(name + ".weight", 4);
  const std::vector<int>& sizes = weights.sizes;
  if (sizes[2] != sizes[3])
    throw Error(ExitCode::BadInput, fmt::format("{}.weight: {}x{} pixels are not square", name, sizes[2], sizes[3]));
  if (in == kNetworkInput) network.inputs = sizes[1];
  add(LayerKind::Convolution, name, {in});
  NetworkLayer& layer = network.layers.back();
  layer.outputs = sizes[0];
  layer.kernel = sizes[2];
  layer.weights = std::move(weights.values);
  layer.bias = std::move(take(name + ".bias", 1).values);
  return name;
}

}  // namespace

Network oidnUnet(WeightTensors weights) {
  const bool large = weights.count("dec_conv1c.weight") > 0;
  Builder b(std::move(weights));
  const auto down = [&](const std::string& name, const std::string& in) {
    return b.pool(large ? b.convolutions(name, in) : b.convolution(name, in));
  };
  const std::string p1 = down("enc_conv1", large ? kNetworkInput : b.convolution("enc_conv0", kNetworkInput));
  const std::string p2 = down("enc_conv2", p1), p3 = down("enc_conv3", p2), p4 = down("enc_conv4", p3);
  std::string t = b.convolutions("enc_conv5", p4);
  t = b.convolutions("dec_conv4", b.up(t, p3));
  t = b.convolutions("dec_conv3", b.up(t, p2));
  t = b.convolutions("dec_conv2", b.up(t, p1));
  t = b.convolutions("dec_conv1", b.up(t, kNetworkInput));
  b.convolution(large ? "dec_conv1c" : "dec_conv0", t);
  return std::move(b.network);
}

}  // namespace braid
