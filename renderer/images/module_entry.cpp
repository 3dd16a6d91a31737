// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "renderer/images/image_module.h"

// Its address is looked up under kImageModuleEntry.
extern "C" __attribute__((visibility("default"))) const braid::ImageCodecs* braidImageCodecs(const char* version) {
  return std::strcmp(version, BRAID_IMAGE_MODULE_VERSION) == 0 ? &braid::imageCodecs() : nullptr;
}
