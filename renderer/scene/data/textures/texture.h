// SPDX-License-Identifier: Apache-2.0
// Images and textures: an image is decoded once and shared; a texture adds wrapping, filtering and the transfer
// function.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "renderer/core/vec.h"

namespace braid {

// Decoded pixels, row 0 at the top (glTF: uv (0,0) is the upper left corner). Exactly one of bytes/floats is filled.
struct Image {
  std::string name;
  std::string format;  // of the file, as ImageReader::format(), "webp" or "ktx2"; empty: it is of no file
  int width = 0, height = 0;
  int channels = 0;  // 1 grey, 2 grey+alpha, 3 RGB, 4 RGBA
  std::vector<uint8_t> bytes;
  std::vector<float> floats;   // linear, unless the source held 16-bit integers:
  size_t limited = 0;          // floats that were not finite, negative, or larger than an image can mean
  bool integerFloats = false;  // floats are 16-bit integers scaled to [0,1], sRGB-encoded when the texture is a colour
  bool hasAlpha() const { return channels == 2 || channels == 4; }
};

enum class Wrap : uint8_t { Repeat, Mirror, Clamp };
enum class Filter : uint8_t { Nearest, Linear };

class Texture {
 public:
  Texture() = default;
  // `srgb`: colour channels of 8-bit images are decoded from sRGB before filtering; alpha is always linear.
  Texture(std::shared_ptr<const Image> image, bool srgb, Wrap wrapU, Wrap wrapV, Filter filter);

  // Linear RGBA at texture coordinates uv; bilinear unless the filter is nearest; grey is replicated, missing alpha
  // is 1.
  Vec4 sample(Vec2 uv) const;

  // Whether no texel has any of the wanted colour channels (a factor that is not 0): nothing brighter than the two
  // darkest steps of 8 bits, which black is after a lossy compression.
  bool isBlack(const Spectrum& factor) const;

  const Image& image() const { return *image_; }
  std::shared_ptr<const Image> sharedImage() const { return image_; }
  bool srgb() const { return srgb_; }
  size_t bytes() const;

 private:
  template <class Texels>
  Vec4 filtered(const Texels& texels, Vec2 uv) const;

  std::shared_ptr<const Image> image_;
  // Copied out of the image: sampling is the innermost loop of shading.
  const uint8_t* bytes_ = nullptr;
  const float* floats_ = nullptr;
  const float* colourTable_ = nullptr;  // from a byte to a linear value
  int width_ = 0, height_ = 0, channels_ = 0;
  bool srgb_ = false;
  Wrap wrapU_ = Wrap::Repeat, wrapV_ = Wrap::Repeat;
  Filter filter_ = Filter::Linear;
};

// Decodes an encoded image (PNG, JPEG, WebP, AVIF, KTX2, HDR, EXR, …) held in memory, with unassociated alpha: that of
// formats which store colours multiplied by it (EXR, some TIFF) is divided out. Colour profiles and gamma chunks are
// ignored, as glTF demands. Throws Error(BadInput) with a one-line reason; refuses images over 2^28 pixels.
std::shared_ptr<const Image> decodeImage(const uint8_t* data, size_t bytes, const std::string& name);

// The same from a file, for environments: colours stay multiplied by alpha where the file has them so.
std::shared_ptr<const Image> readImageFile(const std::string& path);

// Where a material reads a texture: which texture, which uv set, and KHR_texture_transform as a 2x3 matrix.
struct TextureRef {
  int32_t texture = -1;  // index into Scene textures; -1: none
  uint8_t uvSet = 0;
  bool transformed = false;
  std::array<float, 6> matrix{1, 0, 0, 0, 1, 0};  // row-major: u' = m0 u + m1 v + m2, v' = m3 u + m4 v + m5

  explicit operator bool() const { return texture >= 0; }
  Vec2 apply(Vec2 uv) const {
    if (!transformed) return uv;
    return {matrix[0] * uv.x + matrix[1] * uv.y + matrix[2], matrix[3] * uv.x + matrix[4] * uv.y + matrix[5]};
  }
};

}  // namespace braid
