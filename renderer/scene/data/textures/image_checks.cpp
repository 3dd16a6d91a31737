// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/textures/image_checks.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/error.h"
#include "renderer/core/image_values.h"

namespace braid {

void checkImageSize(int width, int height, int channels, uint64_t fileBytes) {
  constexpr uint64_t kMaxPixels = uint64_t(1) << 28;
  const std::string size = std::to_string(width) + " x " + std::to_string(height);
  if (width < 1 || height < 1 || channels < 1)
    throw Error(ExitCode::BadInput, "is an image of " + size + " pixels; save it as a flat picture");
  const uint64_t pixels = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
  if (pixels > kMaxPixels)
    throw Error(ExitCode::BadInput, "is an image of " + size + " pixels, more than 2^28; make it smaller");
  if (!canHold(fileBytes, pixels * static_cast<uint64_t>(channels))) {
    throw Error(ExitCode::BadInput, "claims " + size + " pixels in " + std::to_string(fileBytes) +
                                        " bytes, which cannot be: it is damaged; save it again");
  }
}

void limitFloats(Image& image) {
  for (float& v : image.floats) {
    const float meant = std::isfinite(v) ? std::clamp(v, 0.0f, kLargestRadiance) : 0.0f;
    image.limited += meant != v;
    v = meant;
  }
}

}  // namespace braid
