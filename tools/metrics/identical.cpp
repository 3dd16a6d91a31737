// SPDX-License-Identifier: Apache-2.0
#include "tools/metrics/identical.h"

#include <bit>
#include <cstdint>

#include <fmt/format.h>

namespace braid {

namespace {

std::string missingChannel(const ImageFile& image, const ImageFile& other) {
  for (const auto& [name, plane] : image.planes)
    if (other.planes.count(name) == 0) return fmt::format("channel {} is not in {}", name, other.path);
  return {};
}

std::string firstDifference(const std::string& channel, const Plane<float>& a, const Plane<float>& b) {
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x)
      if (std::bit_cast<uint32_t>(a.at(x, y)) != std::bit_cast<uint32_t>(b.at(x, y)))
        return fmt::format("channel {}, pixel {},{}: {:.9g} and {:.9g}", channel, x, y, a.at(x, y), b.at(x, y));
  return {};
}

}  // namespace

std::string firstDifference(const ImageFile& image, const ImageFile& reference) {
  if (image.width != reference.width || image.height != reference.height || !(image.window == reference.window))
    return fmt::format("{}x{} and {}x{} pixels, or other windows", image.width, image.height, reference.width,
                       reference.height);
  for (const auto& missing : {missingChannel(image, reference), missingChannel(reference, image)})
    if (!missing.empty()) return missing;
  for (const auto& [name, plane] : image.planes)
    if (std::string difference = firstDifference(name, plane, reference.planes.at(name)); !difference.empty())
      return difference;
  return {};
}

}  // namespace braid
