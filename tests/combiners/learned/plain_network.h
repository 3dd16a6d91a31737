// SPDX-License-Identifier: Apache-2.0
// Networks as nested loops over whole images, a plain library of convolutions, and files of random weights.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "combiners/learned/convolution.h"
#include "combiners/learned/network.h"
#include "combiners/learned/tiled_network.h"
#include "combiners/learned/tza.h"

namespace braid::test {

// In [0, 1), by number.
inline float noiseAt(uint64_t seed, uint64_t i) {
  uint64_t x = (seed + 1) * 0x9E3779B97F4A7C15ull + i * 0xBF58476D1CE4E5B9ull;
  for (int k = 0; k < 2; ++k) x = (x ^ (x >> 29)) * 0x94D049BB133111EBull;
  return static_cast<float>(x >> 40) / static_cast<float>(1 << 24);
}

struct Planar {
  int channels = 0, width = 0, height = 0;
  std::vector<float> values;
  Planar(int c, int w, int h)
      : channels(c), width(w), height(h), values(static_cast<size_t>(c) * static_cast<size_t>(w * h)) {}
  float& at(int c, int x, int y) { return values[static_cast<size_t>((c * height + y) * width + x)]; }
  float at(int c, int x, int y) const { return values[static_cast<size_t>((c * height + y) * width + x)]; }
};

inline Planar randomPlanar(int channels, int width, int height, uint64_t seed = 7) {
  Planar image(channels, width, height);
  for (size_t i = 0; i < image.values.size(); ++i) image.values[i] = noiseAt(seed, i);
  return image;
}

inline Planar plainConvolution(const NetworkLayer& layer, const Planar& in) {
  Planar out(layer.outputs, in.width, in.height);
  const int k = layer.kernel, r = k / 2;
  for (int o = 0; o < out.channels; ++o)
    for (int y = 0; y < in.height; ++y)
      for (int x = 0; x < in.width; ++x) {
        double sum = static_cast<double>(layer.bias[static_cast<size_t>(o)]);
        for (int i = 0; i < in.channels; ++i)
          for (int v = std::max(0, r - y); v < std::min(k, in.height + r - y); ++v)
            for (int u = std::max(0, r - x); u < std::min(k, in.width + r - x); ++u)
              sum += static_cast<double>(layer.weights[static_cast<size_t>(((o * in.channels + i) * k + v) * k + u)]) *
                     static_cast<double>(in.at(i, x + u - r, y + v - r));
        out.at(o, x, y) = static_cast<float>(layer.relu ? std::max(0.0, sum) : sum);
      }
  return out;
}

inline Planar plainLayer(const NetworkLayer& layer, const std::vector<const Planar*>& in) {
  if (layer.kind == LayerKind::Convolution) return plainConvolution(layer, *in[0]);
  const bool pool = layer.kind == LayerKind::MaxPool, up = layer.kind == LayerKind::Upsample;
  int channels = 0;
  for (const Planar* p : in) channels += p->channels;
  Planar out(channels,
             pool ? in[0]->width / 2
             : up ? 2 * in[0]->width
                  : in[0]->width,
             pool ? in[0]->height / 2
             : up ? 2 * in[0]->height
                  : in[0]->height);
  int o = 0;
  for (const Planar* p : in)
    for (int c = 0; c < p->channels; ++c, ++o)
      for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x)
          out.at(o, x, y) = pool ? std::max({p->at(c, 2 * x, 2 * y), p->at(c, 2 * x + 1, 2 * y),
                                             p->at(c, 2 * x, 2 * y + 1), p->at(c, 2 * x + 1, 2 * y + 1)})
                            : up ? p->at(c, x / 2, y / 2)
                                 : p->at(c, x, y);
  return out;
}

// The network on the whole image, continued by zeros to a multiple of `multiple`.
inline Planar plainNetwork(const Network& network, const Planar& image, int multiple) {
  const auto rounded = [&](int size) { return (size + multiple - 1) / multiple * multiple; };
  Planar padded(image.channels, rounded(image.width), rounded(image.height));
  for (int c = 0; c < padded.channels; ++c)
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) padded.at(c, x, y) = image.at(c, x, y);
  std::map<std::string, Planar> made{{kNetworkInput, padded}};
  for (const NetworkLayer& layer : network.layers) {
    std::vector<const Planar*> in;
    for (const std::string& name : layer.inputs) in.push_back(&made.at(name));
    made.emplace(layer.name, plainLayer(layer, in));
  }
  const Planar& whole = made.at(network.layers.back().name);
  Planar out(whole.channels, image.width, image.height);
  for (int c = 0; c < out.channels; ++c)
    for (int y = 0; y < out.height; ++y)
      for (int x = 0; x < out.width; ++x) out.at(c, x, y) = whole.at(c, x, y);
  return out;
}

inline Planar run(TiledNetwork& network, const Planar& image, int outputs) {
  Planar out(outputs, image.width, image.height);
  NetworkImage job;
  job.width = image.width;
  job.height = image.height;
  job.read = [&](int y, int x0, int x1, float* row) {
    for (int x = x0; x < x1; ++x)
      for (int c = 0; c < image.channels; ++c) *row++ = image.at(c, x, y);
  };
  job.write = [&](int y, int x0, int x1, const float* row) {
    for (int x = x0; x < x1; ++x)
      for (int c = 0; c < outputs; ++c) out.at(c, x, y) = *row++;
  };
  network.run(job);
  return out;
}

// The largest difference, relative to 1 and the value.
inline double largestDifference(const Planar& a, const Planar& b) {
  double most = 0;
  for (size_t i = 0; i < a.values.size(); ++i)
    most = std::max(most, static_cast<double>(std::abs(a.values[i] - b.values[i])) /
                              (1 + static_cast<double>(std::abs(b.values[i]))));
  return most;
}

// Loops over blocked tensors, four channels a block.
class PlainConvolutions final : public ConvolutionLibrary {
 public:
  static constexpr int kBlock = 4;
  int block() const override { return kBlock; }
  std::unique_ptr<ConvolutionLayer> layer(const ConvolutionWeights& weights, std::string&) const override {
    return std::make_unique<Layer>(weights);
  }

 private:
  struct Run : Convolution {
    Run(const ConvolutionWeights& weights, const ConvolutionSize& of) : w(weights), size(of) {}
    size_t scratchValues() const override { return 0; }
    bool run(const float* in, float* out, float*) const override {
      const int width = size.left + size.width + size.right - w.kernel + 1,
                height = size.top + size.height + size.bottom - w.kernel + 1;
      for (int o = 0; o < w.outputs; ++o)
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x)
            out[((o / kBlock * height + y) * width + x) * kBlock + o % kBlock] = at(in, o, x - size.left, y - size.top);
      return true;
    }
    float at(const float* in, int o, int x0, int y0) const {
      float sum = w.bias[static_cast<size_t>(o)];
      for (int i = 0; i < w.inputs; ++i)
        for (int v = std::max(0, -y0); v < std::min(w.kernel, size.height - y0); ++v)
          for (int u = std::max(0, -x0); u < std::min(w.kernel, size.width - x0); ++u)
            sum += w.weights[static_cast<size_t>(((o * w.inputs + i) * w.kernel + v) * w.kernel + u)] *
                   in[((i / kBlock * size.height + y0 + v) * size.width + x0 + u) * kBlock + i % kBlock];
      return w.relu ? std::max(0.0f, sum) : sum;
    }
    const ConvolutionWeights& w;
    ConvolutionSize size;
  };
  struct Layer : ConvolutionLayer {
    explicit Layer(const ConvolutionWeights& weights) : w(weights) {}
    std::unique_ptr<Convolution> prepare(const ConvolutionSize& size, std::string&) override {
      return std::make_unique<Run>(w, size);
    }
    size_t bytes() const override { return w.weights.size() * sizeof(float); }
    ConvolutionWeights w;
  };
};

// oneDNN, or null with a message: then there is nothing to test.
inline const ConvolutionLibrary* oneDnn() {
  std::string reason;
  const ConvolutionLibrary* library = openConvolutions(reason);
  if (!library) MESSAGE("networks are not tested: ", reason);
  return library;
}

// Weights under which values keep their order of magnitude from layer to layer.
inline WeightTensor randomWeights(int outputs, int inputs, int kernel, uint64_t seed) {
  WeightTensor tensor{{outputs, inputs, kernel, kernel}, {}};
  const float scale = std::sqrt(6.0f / static_cast<float>(inputs * kernel * kernel));
  for (size_t i = 0; i < static_cast<size_t>(outputs * inputs * kernel * kernel); ++i)
    tensor.values.push_back(scale * (2 * noiseAt(seed, i) - 1));
  return tensor;
}

// Of a U-Net as Open Image Denoise's, with `width` channels at the top and more below.
inline WeightTensors randomUnet(int inputs, int width, bool large, uint64_t seed = 1) {
  WeightTensors all;
  const auto add = [&](const std::string& name, int in, int out) {
    all[name + ".weight"] = randomWeights(out, in, 3, seed + all.size());
    all[name + ".bias"] = {{out}, randomWeights(out, 1, 1, seed + all.size()).values};
    for (float& value : all[name + ".bias"].values) value *= 0.1f;
    return out;
  };
  int at = large ? inputs : add("enc_conv0", inputs, width);
  std::vector<int> beside{inputs};
  for (int level = 1; level <= 4; ++level) {
    const std::string name = "enc_conv" + std::to_string(level);
    const int to = width + 3 * (level - 1);
    at = large ? add(name + "b", add(name + "a", at, to), to) : add(name, at, to);
    beside.push_back(at);
  }
  at = add("enc_conv5b", add("enc_conv5a", at, width), width);
  for (int level = 4; level >= 1; --level) {
    const std::string name = "dec_conv" + std::to_string(level);
    at = add(name + "b", add(name + "a", at + beside[static_cast<size_t>(level - 1)], width + level), width);
  }
  add(large ? "dec_conv1c" : "dec_conv0", at, 3);
  return all;
}

inline void append(std::vector<uint8_t>& file, const void* data, size_t bytes) {
  const auto* from = static_cast<const uint8_t*>(data);
  file.insert(file.end(), from, from + bytes);
}
template <class T>
void appendNumber(std::vector<uint8_t>& file, T value) {
  append(file, &value, sizeof value);
}

// A TZA file of 32-bit floats.
inline std::vector<uint8_t> tzaOf(const WeightTensors& tensors) {
  std::vector<uint8_t> file, table;
  appendNumber<uint16_t>(file, 0x41D7);
  appendNumber<uint16_t>(file, 2);
  appendNumber<uint64_t>(file, 0);
  appendNumber(table, static_cast<uint32_t>(tensors.size()));
  for (const auto& [name, tensor] : tensors) {
    appendNumber(table, static_cast<uint16_t>(name.size()));
    append(table, name.data(), name.size());
    appendNumber(table, static_cast<uint8_t>(tensor.sizes.size()));
    for (const int size : tensor.sizes) appendNumber(table, static_cast<uint32_t>(size));
    append(table, tensor.sizes.size() == 1 ? "x" : "oihw", tensor.sizes.size());
    table.push_back('f');
    appendNumber(table, static_cast<uint64_t>(file.size()));
    append(file, tensor.values.data(), tensor.values.size() * sizeof(float));
  }
  const uint64_t begin = file.size();
  std::memcpy(file.data() + 4, &begin, sizeof begin);
  append(file, table.data(), table.size());
  return file;
}

inline void writeTza(const std::string& path, const WeightTensors& tensors) {
  const std::vector<uint8_t> file = tzaOf(tensors);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
}

}  // namespace braid::test
