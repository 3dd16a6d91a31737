// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/textures/ktx2_image.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/data/textures/image_checks.h"
#include "renderer/scene/data/ktx2/ktx2.h"

namespace braid {

namespace {

float normalZ(float red, float green) {
  const float x = 2 * red - 1, y = 2 * green - 1;
  return 0.5f + 0.5f * std::sqrt(std::max(0.0f, 1 - x * x - y * y));
}

}  // namespace

bool isKtx2(const uint8_t* data, size_t bytes) { return ktx2::isKtx2({data, bytes}); }

std::shared_ptr<const Image> decodeKtx2(const uint8_t* data, size_t bytes, const std::string& name, Ktx2Facts& facts) {
  ktx2::Picture picture = ktx2::decode({data, bytes});
  facts = {picture.srgb, picture.isSeveral, picture.isRedGreen};
  auto image = std::make_shared<Image>();
  image->format = "ktx2";
  image->name = name;
  image->width = picture.width;
  image->height = picture.height;
  image->channels = picture.channels;
  image->bytes = std::move(picture.bytes);
  image->floats = std::move(picture.floats);
  image->integerFloats = picture.isInteger && picture.srgb;
  limitFloats(*image);
  return image;
}

std::shared_ptr<const Image> decodeKtx2(const uint8_t* data, size_t bytes, const std::string& name) {
  Ktx2Facts ignored;
  return decodeKtx2(data, bytes, name, ignored);
}

std::shared_ptr<const Image> withNormalZ(const Image& image) {
  auto result = std::make_shared<Image>(image);
  for (size_t i = 0; i + 2 < result->bytes.size(); i += 3) {
    const uint8_t* texel = &image.bytes[i];
    const float z = normalZ(static_cast<float>(texel[0]) / 255, static_cast<float>(texel[1]) / 255);
    result->bytes[i + 2] = static_cast<uint8_t>(std::lround(z * 255));
  }
  for (size_t i = 0; i + 2 < result->floats.size(); i += 3)
    result->floats[i + 2] = normalZ(image.floats[i], image.floats[i + 1]);
  return result;
}

}  // namespace braid
