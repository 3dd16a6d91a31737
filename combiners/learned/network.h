// SPDX-License-Identifier: Apache-2.0
// Convolutional networks as values: layers in the order in which they run, each naming what it reads. Where the weights
// came from is not known here (combiners/learned/tza.h reads one kind of file).
#pragma once

#include <string>
#include <vector>

namespace braid {

// What a network reads has this name; what a layer makes has the layer's.
inline constexpr const char* kNetworkInput = "input";

enum class LayerKind {
  Convolution,  // stride 1, zeros around the image
  MaxPool,      // 2x2 pixels become one
  Upsample,     // a pixel becomes 2x2
  Concatenate,  // the channels of all inputs, in their order
};

struct NetworkLayer {
  std::string name;
  LayerKind kind = LayerKind::Convolution;
  std::vector<std::string> inputs;

  // Of convolutions.
  int outputs = 0;  // channels
  int kernel = 3;   // or 1
  bool relu = true;
  std::vector<float> weights;  // [output][input][row][column]
  std::vector<float> bias;     // [output]
};

struct Network {
  int inputs = 0;                    // channels
  std::vector<NetworkLayer> layers;  // the last one makes the output
};

// The same with indices in the place of names: tensor 0 is the input of the network, tensor i + 1 what layer i makes.
struct NetworkGraph {
  struct Tensor {
    int channels = 0;
    int level = 0;  // its pixels are 2^level of the image's wide
  };
  std::vector<Tensor> tensors;
  std::vector<std::vector<size_t>> inputs;  // of each layer
  // Of each tensor: made by upsampling and read by concatenation only, so that it is made there and takes no memory.
  std::vector<bool> joined;
  int levels = 0;  // the highest level: images have a multiple of 2^levels pixels
};

// Throws Error(BadInput) naming the layer that is wrong.
NetworkGraph graphOf(const Network& network);

}  // namespace braid
