// SPDX-License-Identifier: Apache-2.0
// Writes AVIF files for tests: lossless, by libavif.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include <avif/avif.h>
#include <doctest/doctest.h>

namespace braid::test {

struct AvifOptions {
  uint32_t width = 1, height = 1, depth = 8;
  bool alpha = false, premultiplied = false;
  uint8_t quarterTurns = 0;  // counter-clockwise, done by who shows it
  int mirror = -1;           // 0: top and bottom change places, 1: left and right
};

// `rgba`: RGBA, interleaved, in `depth` bits.
template <class Sample>
std::vector<uint8_t> avifOf(const std::vector<Sample>& rgba, const AvifOptions& options) {
  avifImage* image = avifImageCreate(options.width, options.height, options.depth, AVIF_PIXEL_FORMAT_YUV444);
  // Colours are stored as they are, as green, blue and red.
  image->matrixCoefficients = AVIF_MATRIX_COEFFICIENTS_IDENTITY;
  image->yuvRange = AVIF_RANGE_FULL;
  image->alphaPremultiplied = options.premultiplied;
  avifRGBImage rgb;
  avifRGBImageSetDefaults(&rgb, image);
  rgb.ignoreAlpha = !options.alpha;
  rgb.alphaPremultiplied = options.premultiplied;  // as it is: nothing is multiplied
  std::vector<Sample> pixels = rgba;
  rgb.pixels = reinterpret_cast<uint8_t*>(pixels.data());
  rgb.rowBytes = options.width * 4 * static_cast<uint32_t>(sizeof(Sample));
  REQUIRE(avifImageRGBToYUV(image, &rgb) == AVIF_RESULT_OK);
  if (options.quarterTurns != 0) {
    image->transformFlags |= AVIF_TRANSFORM_IROT;
    image->irot.angle = options.quarterTurns;
  }
  if (options.mirror >= 0) {
    image->transformFlags |= AVIF_TRANSFORM_IMIR;
    image->imir.mode = static_cast<uint8_t>(options.mirror);
  }
  avifEncoder* encoder = avifEncoderCreate();
  encoder->speed = AVIF_SPEED_FASTEST;
  encoder->minQuantizer = encoder->maxQuantizer = AVIF_QUANTIZER_LOSSLESS;
  encoder->minQuantizerAlpha = encoder->maxQuantizerAlpha = AVIF_QUANTIZER_LOSSLESS;
  avifRWData out = AVIF_DATA_EMPTY;
  REQUIRE(avifEncoderWrite(encoder, image, &out) == AVIF_RESULT_OK);
  std::vector<uint8_t> bytes(out.data, out.data + out.size);
  avifRWDataFree(&out);
  avifEncoderDestroy(encoder);
  avifImageDestroy(image);
  return bytes;
}

}  // namespace braid::test
