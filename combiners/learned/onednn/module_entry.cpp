// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "combiners/learned/onednn/onednn_convolutions.h"

// Its address is looked up under kConvolutionModuleEntry.
extern "C" __attribute__((visibility("default"))) const braid::ConvolutionLibrary* braidConvolutions(
    const char* version) {
  return std::strcmp(version, BRAID_CONVOLUTION_MODULE_VERSION) == 0 ? &braid::oneDnnConvolutions() : nullptr;
}
