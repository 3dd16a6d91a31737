// SPDX-License-Identifier: Apache-2.0
// Runs a network over an image, tile by tile, each by one thread: the tiles depend on the image and the network alone,
// so that the result has the same bits for any number of threads, and memory is bounded whatever the image.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "combiners/learned/blocked_tensor.h"

namespace braid {

// The memory of a tile, which its size follows from: larger tiles share fewer pixels with their neighbours, of which
// there are a fifth more than in the image at this size for a U-Net of four levels with 32 channels at the top.
constexpr size_t kTileBytes = size_t(96) << 20;

struct NetworkImage {
  int width = 0, height = 0;
  // Writes the channels of the pixels [x0, x1) of a row, side by side. Called by several threads at once.
  std::function<void(int y, int x0, int x1, float* row)> read;
  // Takes what the network makes of them, in the same order.
  std::function<void(int y, int x0, int x1, const float* row)> write;
  const std::atomic<bool>* cancel = nullptr;  // once set, what is left of the image is left out
};

class TiledNetwork {
 public:
  // `library` must outlive it. Throws Error(BadInput) for a network that is none.
  TiledNetwork(Network network, const ConvolutionLibrary& library, size_t tileBytes = kTileBytes);

  // The image is continued to whole pixels of the highest level by zeros: copies of its last row are streaks, which a
  // denoiser takes for a texture. Throws Error(Internal) where the library fails.
  void run(const NetworkImage& image);

  // Bytes that each thread takes for an image of this size, and that all share, once it has run.
  size_t threadBytes(int width, int height) const;
  size_t sharedBytes() const;
  // Whole tiles are so wide and high at most.
  int tileSide() const { return side_; }
  int inputs() const { return network_.inputs; }

 private:
  struct Layer {
    std::unique_ptr<ConvolutionLayer> convolution;  // null: another kind
    std::map<ConvolutionSize, std::unique_ptr<Convolution>> prepared;
  };

  TileRegion padded(int width, int height) const;
  std::vector<TileRegion> tiles(const TileRegion& image) const;
  TilePlan plan(const TileRegion& tile, const TileRegion& image) const;
  const Convolution& prepared(size_t layer, const ConvolutionSize& size);
  void runTile(const TileRegion& tile, const TileRegion& padded, const NetworkImage& image);
  void runLayer(size_t layer, const TilePlan& plan, float* memory);
  void readInput(const BlockedTensor& input, const NetworkImage& image) const;
  void writeOutput(const BlockedTensor& output, const TileRegion& tile, const NetworkImage& image) const;

  Network network_;
  NetworkGraph graph_;
  int block_, side_ = 0;
  std::vector<Layer> layers_;
  std::mutex mutex_;  // of what is prepared
};

// The widest whole tile whose memory is within `tileBytes`; never less than one pixel of the highest level.
int tileSideWithin(const Network& network, const NetworkGraph& graph, int block, size_t tileBytes);

}  // namespace braid
