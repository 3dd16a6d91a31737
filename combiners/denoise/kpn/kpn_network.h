// SPDX-License-Identifier: Apache-2.0
// The network of kpn, and what it says of an image.
#pragma once

#include <atomic>
#include <string>

#include "combiners/denoise/kpn/kpn_filter.h"
#include "combiners/denoise/kpn/kpn_planes.h"
#include "combiners/learned/tiled_network.h"

namespace braid {

class KpnNetwork {
 public:
  // Throws Error(BadInput) naming the file where it is no network of kpn. The library must outlive this.
  KpnNetwork(const std::string& file, const ConvolutionLibrary& library);

  // The image, filtered.
  Rgb<float> denoise(KpnPlanes planes, const std::atomic<bool>* cancel);

 private:
  KpnFeatures describe(const KpnPlanes& planes, const std::atomic<bool>* cancel);

  KpnTests tests_;
  TiledNetwork network_;
};

}  // namespace braid
