// SPDX-License-Identifier: Apache-2.0
// A network that reads planes and says numbers of every pixel. It may see squares of pixels as single ones with more
// channels, which makes it several times faster; how many follows from its channels: those of a plane, or of a number,
// lie side by side, row by row.
#pragma once

#include <atomic>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "combiners/learned/tiled_network.h"
#include "renderer/core/plane.h"

namespace braid {

class PlaneNetwork {
 public:
  // Throws Error(BadInput) naming the file where it is no network of so many planes. The library must outlive this.
  PlaneNetwork(const std::string& file, int planes, const ConvolutionLibrary& library);

  int outputs() const { return outputs_; }  // numbers of a pixel
  int packed() const { return side_; }      // the side of the squares

  // Takes the numbers of the pixels [x0, x1) of a row, those of a pixel side by side; by several threads at once.
  using Write = std::function<void(int y, int x0, int x1, const float* row)>;
  void run(std::span<const Plane<float>> planes, const Write& write, const std::atomic<bool>* cancel);

 private:
  int side_ = 1, outputs_ = 0;
  TiledNetwork network_;
};

}  // namespace braid
