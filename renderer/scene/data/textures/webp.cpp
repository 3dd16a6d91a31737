// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/textures/webp.h"

#include <cstring>

#include <webp/decode.h>
#include <webp/demux.h>

#include "renderer/core/error.h"
#include "renderer/scene/data/textures/image_checks.h"

namespace braid {

namespace {

[[noreturn]] void failBroken() {
  throw Error(ExitCode::BadInput, "is a broken image (libwebp cannot decode it); save it again");
}

// The first picture of an animation on its canvas.
void decodeFirst(const uint8_t* data, size_t bytes, std::vector<uint8_t>& rgba) {
  WebPAnimDecoderOptions options;
  if (!WebPAnimDecoderOptionsInit(&options)) failBroken();
  options.color_mode = MODE_RGBA;
  const WebPData source{data, bytes};
  const std::unique_ptr<WebPAnimDecoder, decltype(&WebPAnimDecoderDelete)> decoder(
      WebPAnimDecoderNew(&source, &options), WebPAnimDecoderDelete);
  uint8_t* pixels = nullptr;
  int time = 0;
  if (!decoder || !WebPAnimDecoderGetNext(decoder.get(), &pixels, &time)) failBroken();
  std::memcpy(rgba.data(), pixels, rgba.size());
}

}  // namespace

bool isWebp(const uint8_t* data, size_t bytes) {
  return bytes >= 12 && std::memcmp(data, "RIFF", 4) == 0 && std::memcmp(data + 8, "WEBP", 4) == 0;
}

std::shared_ptr<const Image> decodeWebp(const uint8_t* data, size_t bytes, const std::string& name) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes, &features) != VP8_STATUS_OK) failBroken();
  const bool animated = features.has_animation != 0;
  auto image = std::make_shared<Image>();
  image->format = "webp";
  image->name = name;
  image->width = features.width;
  image->height = features.height;
  image->channels = features.has_alpha || animated ? 4 : 3;
  // An animation is decoded on two canvases.
  checkImageSize(image->width, image->height, image->channels * (animated ? 3 : 1), bytes);
  const size_t row = static_cast<size_t>(image->width) * static_cast<size_t>(image->channels);
  image->bytes.resize(row * static_cast<size_t>(image->height));
  if (animated) {
    decodeFirst(data, bytes, image->bytes);
    return image;
  }
  const auto decode = image->channels == 4 ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
  if (!decode(data, bytes, image->bytes.data(), image->bytes.size(), static_cast<int>(row))) failBroken();
  return image;
}

}  // namespace braid
