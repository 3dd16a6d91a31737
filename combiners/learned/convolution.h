// SPDX-License-Identifier: Apache-2.0
// Convolutions of a library, behind an interface that does not name it: oneDNN (combiners/learned/onednn) takes forty
// megabytes, so it is opened as a module when a network first runs, and where it cannot be opened networks are left
// out.
//
// Tensors are blocked: `block` channels of all pixels, row by row and with the channels of a pixel side by side, then
// the next block. Channels are whole blocks; those that a network does not have hold zeros.
#pragma once

#include <compare>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace braid {

struct ConvolutionWeights {
  int inputs = 0, outputs = 0;  // channels, whole blocks
  int kernel = 3;               // pixels wide and high
  bool relu = true;
  std::vector<float> weights;  // [output][input][row][column]
  std::vector<float> bias;     // [output]
};

// Of the input, and how many rows and columns of zeros are put around it first.
struct ConvolutionSize {
  int width = 0, height = 0;
  int left = 0, top = 0, right = 0, bottom = 0;
  auto operator<=>(const ConvolutionSize&) const = default;
};

// What a convolution takes for its own use while it runs, at most.
constexpr size_t kConvolutionScratch = size_t(10) << 20;

// For one size. Runs in the calling thread alone; several threads may call it at once.
class Convolution {
 public:
  virtual ~Convolution() = default;
  // So many values, aligned like pixels, it wants for its own use in run().
  virtual size_t scratchValues() const = 0;
  // False: the library failed.
  virtual bool run(const float* in, float* out, float* scratch) const = 0;
};

// With its weights in the order that the library likes.
class ConvolutionLayer {
 public:
  virtual ~ConvolutionLayer() = default;
  // For one thread at a time. Null: `error` says why.
  virtual std::unique_ptr<Convolution> prepare(const ConvolutionSize& size, std::string& error) = 0;
  // Of the weights, in all orders that were prepared.
  virtual size_t bytes() const = 0;
};

class ConvolutionLibrary {
 public:
  virtual int block() const = 0;
  virtual std::unique_ptr<ConvolutionLayer> layer(const ConvolutionWeights& weights, std::string& error) const = 0;

 protected:
  ~ConvolutionLibrary() = default;
};

// Opened by the first call. Null: it cannot be, and `reason` is a sentence that says why.
const ConvolutionLibrary* openConvolutions(std::string& reason);

// Whether there is a file to open: false, and why, without opening it.
bool convolutionsInstalled(std::string& reason);

// What the module exports; null: it is of another version of braid.
inline constexpr const char* kConvolutionModuleEntry = "braidConvolutions";
using ConvolutionModuleEntry = const ConvolutionLibrary* (*)(const char* version);

}  // namespace braid
