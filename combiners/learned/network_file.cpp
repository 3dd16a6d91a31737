// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/network_file.h"

#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "combiners/learned/weights_file.h"
#include "renderer/core/error.h"

namespace braid {

namespace {

using nlohmann::json;

constexpr std::string_view kMagic = "BRAIDNET";
constexpr uint32_t kVersion = 1;
constexpr uint64_t kLargestFile = uint64_t(64) << 20;
constexpr size_t kMostLayers = 256, kHead = 16;
constexpr int kMostChannels = 4096;

class Parser {
 public:
  Parser(std::span<const uint8_t> file, const std::string& path) : file_(file), path_(path) {}
  NetworkFile parse();

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(ExitCode::BadInput, fmt::format("{}: {}", path_, what));
  }
  uint32_t number(size_t at) const {
    uint32_t value;
    std::memcpy(&value, file_.data() + at, sizeof value);
    return value;
  }
  json description();
  int whole(const json& of, const char* name, int most, const std::string& where) const;
  NetworkLayer layer(const json& of) const;
  // The channels of what each layer makes, by name, up to those of its inputs.
  int inputChannels(const NetworkLayer& layer) const;
  void readValues(NetworkLayer& layer);
  std::vector<float> values(size_t count, const std::string& layer);

  std::span<const uint8_t> file_;
  const std::string& path_;
  size_t at_ = 0;
  std::map<std::string, int> channels_;
};

json Parser::description() {
  if (file_.size() < kHead || std::memcmp(file_.data(), kMagic.data(), kMagic.size()) != 0)
    fail("no network of braid: its file begins with BRAIDNET");
  if (number(8) != kVersion) fail(fmt::format("version {}, but only {} is known", number(8), kVersion));
  const uint32_t bytes = number(12);
  if (bytes > file_.size() - kHead) fail(fmt::format("{} bytes of description are not all in the file", bytes));
  at_ = kHead + bytes;
  const auto* text = reinterpret_cast<const char*>(file_.data() + kHead);
  json parsed = json::parse(text, text + bytes, nullptr, false);
  if (!parsed.is_object() || !parsed.contains("layers") || !parsed["layers"].is_array())
    fail("its description is no JSON object with layers");
  if (parsed["layers"].empty() || parsed["layers"].size() > kMostLayers)
    fail(fmt::format("{} layers, 1 to {} are possible", parsed["layers"].size(), kMostLayers));
  return parsed;
}

int Parser::whole(const json& of, const char* name, int most, const std::string& where) const {
  const auto found = of.find(name);
  if (found == of.end() || !found->is_number_integer() || found->get<int64_t>() < 1 || found->get<int64_t>() > most)
    fail(fmt::format("{}: {} is no whole number from 1 to {}", where, name, most));
  return found->get<int>();
}

NetworkLayer Parser::layer(const json& of) const {
  NetworkLayer layer;
  if (!of.is_object() || !of.contains("name") || !of["name"].is_string()) fail("a layer without a name");
  layer.name = of["name"].get<std::string>();
  static const std::map<std::string, LayerKind> kinds = {{"convolution", LayerKind::Convolution},
                                                         {"pool", LayerKind::MaxPool},
                                                         {"upsample", LayerKind::Upsample},
                                                         {"concatenate", LayerKind::Concatenate}};
  const auto kind = kinds.find(of.contains("kind") && of["kind"].is_string() ? of["kind"].get<std::string>() : "");
  if (kind == kinds.end()) fail(layer.name + ": its kind is none of convolution, pool, upsample and concatenate");
  layer.kind = kind->second;
  if (!of.contains("inputs") || !of["inputs"].is_array()) fail(layer.name + ": it has no list of inputs");
  for (const json& input : of["inputs"]) {
    if (!input.is_string()) fail(layer.name + ": an input that is no name");
    layer.inputs.push_back(input.get<std::string>());
  }
  if (layer.kind != LayerKind::Convolution) return layer;
  layer.outputs = whole(of, "outputs", kMostChannels, layer.name);
  layer.kernel = whole(of, "kernel", 3, layer.name);
  layer.relu = !of.contains("relu") || (of["relu"].is_boolean() && of["relu"].get<bool>());
  return layer;
}

int Parser::inputChannels(const NetworkLayer& layer) const {
  int sum = 0;
  for (const std::string& input : layer.inputs) {
    const auto found = channels_.find(input);
    if (found == channels_.end())
      fail(fmt::format("{}: it reads '{}', which no layer before it makes", layer.name, input));
    sum += found->second;
    if (sum > kMostChannels) fail(fmt::format("{}: more than {} channels", layer.name, kMostChannels));
  }
  return sum;
}

std::vector<float> Parser::values(size_t count, const std::string& layer) {
  const size_t bytes = count * sizeof(uint16_t);
  if (bytes > file_.size() - at_) fail(layer + ": its values are not all in the file");
  std::vector<float> out = fromHalves(file_.subspan(at_, bytes));
  at_ += bytes;
  if (!areFinite(out)) fail(layer + ": a value that is not finite");
  return out;
}

void Parser::readValues(NetworkLayer& layer) {
  const int inputs = inputChannels(layer);
  channels_[layer.name] = layer.kind == LayerKind::Convolution ? layer.outputs : inputs;
  if (layer.kind != LayerKind::Convolution) return;
  const auto outputs = static_cast<size_t>(layer.outputs), square = static_cast<size_t>(layer.kernel * layer.kernel);
  layer.weights = values(outputs * static_cast<size_t>(inputs) * square, layer.name);
  layer.bias = values(outputs, layer.name);
}

NetworkFile Parser::parse() {
  const json described = description();
  NetworkFile out;
  out.network.inputs = whole(described, "inputs", kMostChannels, "the description");
  channels_[kNetworkInput] = out.network.inputs;
  for (const json& of : described["layers"]) {
    out.network.layers.push_back(layer(of));
    readValues(out.network.layers.back());
  }
  if (at_ != file_.size()) fail(fmt::format("{} bytes after the last value", file_.size() - at_));
  if (described.contains("constants") && described["constants"].is_object())
    for (const auto& [name, list] : described["constants"].items())
      for (const json& value : list) {
        if (!value.is_number() || !std::isfinite(value.get<float>())) fail(name + ": a constant that is no number");
        out.constants[name].push_back(value.get<float>());
      }
  if (described.contains("training")) out.training = described["training"].dump();
  try {
    graphOf(out.network);
  } catch (const Error& e) {
    fail(e.what());
  }
  return out;
}

}  // namespace

NetworkFile parseNetworkFile(std::span<const uint8_t> file, const std::string& path) {
  return Parser(file, path).parse();
}

NetworkFile readNetworkFile(const std::string& path) {
  return parseNetworkFile(readWeightsFile(path, kLargestFile), path);
}

}  // namespace braid
