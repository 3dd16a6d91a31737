// SPDX-License-Identifier: Apache-2.0
#include "renderer/images/avif_reader.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <avif/avif.h>

namespace braid {

namespace {

constexpr uint32_t kMostPixels = 1u << 28;

struct DecoderDeleter {
  void operator()(avifDecoder* decoder) const { avifDecoderDestroy(decoder); }
};
using Decoder = std::unique_ptr<avifDecoder, DecoderDeleter>;

// From a place in the picture to where it is stored, by HEIF's order: first rotated, then mirrored.
struct Orientation {
  int quarterTurns = 0;  // counter-clockwise
  bool flipX = false, flipY = false;

  explicit Orientation(const avifImage& image) {
    if (image.transformFlags & AVIF_TRANSFORM_IROT) quarterTurns = image.irot.angle & 3;
    if (!(image.transformFlags & AVIF_TRANSFORM_IMIR)) return;
    // 0: top and bottom change places; 1: left and right.
    (image.imir.mode == 0 ? flipY : flipX) = true;
  }
  bool swapsSides() const { return quarterTurns % 2 == 1; }
  bool plain() const { return quarterTurns == 0 && !flipX && !flipY; }
  std::pair<size_t, size_t> stored(size_t x, size_t y, size_t width, size_t height) const {
    const size_t w = swapsSides() ? height : width, h = swapsSides() ? width : height;  // of the picture
    if (flipX) x = w - 1 - x;
    if (flipY) y = h - 1 - y;
    switch (quarterTurns) {
      case 1:
        return {width - 1 - y, x};
      case 2:
        return {width - 1 - x, height - 1 - y};
      case 3:
        return {y, height - 1 - x};
      default:
        return {x, y};
    }
  }
};

class AvifReader : public ImageReader {
 public:
  explicit AvifReader(Decoder decoder) : decoder_(std::move(decoder)), turn_(*decoder_->image) {
    const avifImage& image = *decoder_->image;
    header_.width = static_cast<int>(turn_.swapsSides() ? image.height : image.width);
    header_.height = static_cast<int>(turn_.swapsSides() ? image.width : image.height);
    header_.type = image.depth > 8 ? SampleType::LargerInteger : SampleType::Byte;
    header_.channels = {"R", "G", "B"};
    if (decoder_->alphaPresent) {
      header_.channels.emplace_back("A");
      header_.alpha = 3;
    }
    header_.unassociatedAlpha = true;
  }

  std::string format() const override { return "avif"; }
  bool select(int part) override { return part == 0; }
  const ImageHeader& header() const override { return header_; }
  bool readRows(int, int, float*) override { return fail("rows of it cannot be read"); }

  bool decode() override {
    const uint32_t width = decoder_->image->width, height = decoder_->image->height, depth = decoder_->image->depth;
    if (const avifResult result = avifDecoderNextImage(decoder_.get()); result != AVIF_RESULT_OK) return fail(result);
    const avifImage& image = *decoder_->image;
    // What the payload holds may differ from what the container said.
    if (image.width != width || image.height != height || (image.depth > 8) != (depth > 8))
      return fail("its pixels are others than its header says");
    return true;
  }

  bool readImage(int channels, SampleType type, void* samples) override {
    avifRGBImage rgb;
    avifRGBImageSetDefaults(&rgb, decoder_->image);
    rgb.format = channels == 4 ? AVIF_RGB_FORMAT_RGBA : AVIF_RGB_FORMAT_RGB;
    rgb.ignoreAlpha = channels != 4;
    rgb.avoidLibYUV = AVIF_TRUE;  // its conversion has seven bits
    rgb.depth = type == SampleType::Byte ? 8 : 16;
    const size_t values = size_t{rgb.width} * rgb.height * static_cast<size_t>(channels);
    return type == SampleType::Byte ? convert(rgb, channels, values, static_cast<uint8_t*>(samples))
                                    : convert(rgb, channels, values, static_cast<float*>(samples));
  }

  std::string takeError() override { return std::exchange(error_, {}); }

 private:
  bool fail(const char* why) {
    error_ = why;
    return false;
  }
  bool fail(avifResult result) { return fail(avifResultToString(result)); }

  static void assign(uint8_t& to, uint8_t from) { to = from; }
  static void assign(float& to, uint16_t from) { to = static_cast<float>(from) / 65535; }

  template <class Sample>
  bool convert(avifRGBImage& rgb, int channels, size_t values, Sample* samples) {
    using Stored = std::conditional_t<std::is_same_v<Sample, float>, uint16_t, uint8_t>;
    std::vector<Stored> stored(values);
    rgb.pixels = reinterpret_cast<uint8_t*>(stored.data());
    rgb.rowBytes = rgb.width * static_cast<uint32_t>(static_cast<size_t>(channels) * sizeof(Stored));
    if (const avifResult result = avifImageYUVToRGB(decoder_->image, &rgb); result != AVIF_RESULT_OK)
      return fail(result);
    const auto stride = static_cast<size_t>(channels);
    if (turn_.plain()) {
      for (size_t i = 0; i < values; ++i) assign(samples[i], stored[i]);
      return true;
    }
    for (size_t y = 0, i = 0; y < static_cast<size_t>(header_.height); ++y)
      for (size_t x = 0; x < static_cast<size_t>(header_.width); ++x) {
        const std::pair<size_t, size_t> at = turn_.stored(x, y, rgb.width, rgb.height);
        for (size_t c = 0; c < stride; ++c, ++i)
          assign(samples[i], stored[(at.second * rgb.width + at.first) * stride + c]);
      }
    return true;
  }

  const Decoder decoder_;
  const Orientation turn_;
  ImageHeader header_;
  std::string error_;
};

}  // namespace

bool isAvif(const uint8_t* data, size_t bytes) {
  if (bytes < 16 || std::memcmp(data + 4, "ftyp", 4) != 0) return false;
  const size_t box = (size_t{data[0]} << 24) | (size_t{data[1]} << 16) | (size_t{data[2]} << 8) | data[3];
  for (size_t at = 8; at + 4 <= std::min(box, bytes); at += at == 8 ? 8 : 4)
    if (std::memcmp(data + at, "avif", 4) == 0 || std::memcmp(data + at, "avis", 4) == 0) return true;
  return false;
}

std::unique_ptr<ImageReader> openAvif(const uint8_t* data, size_t bytes, std::string& error) {
  Decoder decoder(avifDecoderCreate());
  decoder->ignoreExif = decoder->ignoreXMP = AVIF_TRUE;
  decoder->imageSizeLimit = kMostPixels;
  // Files of old writers lack the box of bit depths.
  decoder->strictFlags = AVIF_STRICT_ENABLED & ~static_cast<avifStrictFlags>(AVIF_STRICT_PIXI_REQUIRED);
  avifResult result = avifDecoderSetIOMemory(decoder.get(), data, bytes);
  if (result == AVIF_RESULT_OK) result = avifDecoderParse(decoder.get());
  if (result == AVIF_RESULT_OK) {
    // The payload may claim more than the container: it gets no more than that.
    const uint64_t pixels = uint64_t{decoder->image->width} * decoder->image->height;
    decoder->imageSizeLimit = static_cast<uint32_t>(std::clamp<uint64_t>(pixels, 1, kMostPixels));
    result = avifDecoderReset(decoder.get());
  }
  if (result == AVIF_RESULT_OK) return std::make_unique<AvifReader>(std::move(decoder));
  error = avifResultToString(result);
  return nullptr;
}

}  // namespace braid
