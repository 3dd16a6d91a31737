// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/textures/texture.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "renderer/core/error.h"
#include "renderer/core/image_values.h"
#include "renderer/images/image_codecs.h"
#include "renderer/scene/data/textures/image_checks.h"
#include "renderer/scene/data/textures/ktx2_image.h"
#include "renderer/scene/data/textures/webp.h"

namespace braid {

namespace {

struct ByteTables {
  std::array<float, 256> linear, srgb;
  ByteTables() {
    for (size_t i = 0; i < 256; ++i) {
      linear[i] = static_cast<float>(i) / 255.0f;
      srgb[i] = decodeSrgb(linear[i]);
    }
  }
};

const ByteTables& byteTables() {
  static const ByteTables tables;
  return tables;
}

// 16-bit colours: decoded once into a copy, as no table fits them.
std::shared_ptr<const Image> decodedFromSrgb(const Image& image) {
  auto copy = std::make_shared<Image>(image);
  const auto channels = static_cast<size_t>(image.channels);
  for (size_t i = 0; i < copy->floats.size(); ++i) {
    const bool isAlpha = image.hasAlpha() && i % channels == channels - 1;
    if (!isAlpha) copy->floats[i] = decodeSrgb(copy->floats[i]);
  }
  copy->integerFloats = false;
  return copy;
}

// Texel positions of one axis: the two neighbours and the weight of the second.
struct Taps {
  int first, second;
  float weight;
};

// For |x| below 2^31: two instructions, where std::floor is a call unless the build targets SSE 4.1.
inline int floorToInt(float x) {
  const int i = static_cast<int>(x);
  return i - (x < static_cast<float>(i) ? 1 : 0);
}

// Brings a coordinate into [0,1]; anything without a meaningful fraction (NaN, infinity, huge) becomes 0.
inline float wrapped(float u, Wrap wrap) {
  if (!(std::abs(u) < 1e7f)) return 0;
  if (wrap == Wrap::Repeat) return u - static_cast<float>(floorToInt(u));
  if (wrap == Wrap::Clamp) return std::clamp(u, 0.0f, 1.0f);
  const float t = std::abs(u - 2 * static_cast<float>(floorToInt(0.5f * u + 0.5f)));
  return std::min(t, 1.0f);
}

inline Taps linearTaps(float u, Wrap wrap, int size) {
  const float x = wrapped(u, wrap) * static_cast<float>(size) - 0.5f;
  const int low = floorToInt(x);
  Taps taps{low, low + 1, x - static_cast<float>(low)};
  // Only the outermost half texel has a neighbour beyond the border. A mirrored image repeats its border texel there.
  if (taps.first < 0) taps.first = wrap == Wrap::Repeat ? size - 1 : 0;
  if (taps.second >= size) taps.second = wrap == Wrap::Repeat ? 0 : size - 1;
  return taps;
}

inline int nearestTap(float u, Wrap wrap, int size) {
  return std::min(static_cast<int>(wrapped(u, wrap) * static_cast<float>(size)), size - 1);
}

// Texels by layout, so that the number of channels is decided once for all four taps.
template <size_t channels>
struct ByteTexels {
  const uint8_t* data;
  const float* colour;
  Vec4 operator()(size_t index) const {
    const uint8_t* p = data + index * channels;
    const float alpha = channels % 2 == 0 ? static_cast<float>(p[channels - 1]) * (1 / 255.0f) : 1.0f;
    if constexpr (channels >= 3) return {colour[p[0]], colour[p[1]], colour[p[2]], alpha};
    return {colour[p[0]], colour[p[0]], colour[p[0]], alpha};
  }
};

template <size_t channels>
struct FloatTexels {
  const float* data;
  Vec4 operator()(size_t index) const {
    const float* p = data + index * channels;
    const float alpha = channels % 2 == 0 ? p[channels - 1] : 1.0f;
    if constexpr (channels >= 3) return {p[0], p[1], p[2], alpha};
    return {p[0], p[0], p[0], alpha};
  }
};

std::string oneLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// The name that selects a reader; files in glTF buffers have none, so their first bytes decide.
std::string formatName(const uint8_t* data, size_t bytes) {
  const auto begins = [&](const char* magic, size_t length, size_t at = 0) {
    return bytes >= at + length && std::memcmp(data + at, magic, length) == 0;
  };
  if (begins("\x89PNG", 4)) return "image.png";
  if (begins("\xFF\xD8\xFF", 3)) return "image.jpg";
  if (begins("#?", 2)) return "image.hdr";
  if (begins("\x76\x2f\x31\x01", 4)) return "image.exr";
  if (begins("II*\0", 4) || begins("MM\0*", 4)) return "image.tif";
  if (begins("BM", 2)) return "image.bmp";
  if (begins("ftyp", 4, 4)) return "image.avif";
  throw Error(ExitCode::BadInput, "is not an image of a known format; save it as PNG or JPEG");
}

// `data` null: from the file of this name.
std::unique_ptr<ImageReader> openReader(const std::string& name, const uint8_t* data, size_t bytes) {
  std::string error;
  std::unique_ptr<ImageReader> reader = imageCodecs().openNamed(name, data, bytes, error);
  if (reader) return reader;
  throw Error(ExitCode::BadInput, "is not an image that can be read (" + oneLine(error) + "); save it as PNG or JPEG");
}

int keptChannels(const ImageHeader& header) {
  const auto channels = static_cast<int>(header.channels.size());
  if (channels >= 4) return header.alpha == 3 ? 4 : 3;
  if (channels == 2) return header.alpha == 1 ? 2 : 1;
  return channels;
}

// Formats whose alpha is associated by their rules, unless the reader says otherwise.
bool isAssociated(const ImageReader& reader) {
  const std::string format = reader.format();
  return (format == "openexr" || format == "tiff") && !reader.header().unassociatedAlpha;
}

void divideByAlpha(Image& image) {
  const auto channels = static_cast<size_t>(image.channels);
  for (size_t i = channels - 1; i < image.floats.size(); i += channels) {
    const float alpha = image.floats[i];
    for (size_t c = 1; c < channels && alpha > 0; ++c)
      image.floats[i - c] = std::min(image.floats[i - c] / alpha, kLargestRadiance);
  }
  for (size_t i = channels - 1; i < image.bytes.size(); i += channels) {
    const int alpha = image.bytes[i];
    for (size_t c = 1; c < channels && alpha > 0; ++c)
      image.bytes[i - c] = static_cast<uint8_t>(std::min(255, (image.bytes[i - c] * 255 + alpha / 2) / alpha));
  }
}

std::shared_ptr<Image> readPixels(ImageReader& reader, const std::string& name, uint64_t fileBytes) {
  const ImageHeader& header = reader.header();
  if (header.depth > 1) throw Error(ExitCode::BadInput, "is an image of several layers; save it as a flat picture");
  // AV1 packs flat pictures tighter than all others: a byte may hold eleven blocks of 64 x 64 pixels.
  const uint64_t packing = reader.format() == "avif" ? 16 : 1;
  checkImageSize(header.width, header.height, static_cast<int>(header.channels.size()), packing * fileBytes);
  auto image = std::make_shared<Image>();
  image->name = name;
  image->format = reader.format();
  image->width = header.width;
  image->height = header.height;
  image->channels = keptChannels(header);
  const size_t values =
      static_cast<size_t>(header.width) * static_cast<size_t>(header.height) * static_cast<size_t>(image->channels);
  const auto broken = [&] {
    return Error(ExitCode::BadInput, "is a broken image (" + oneLine(reader.takeError()) + "); save it again");
  };
  if (!reader.decode()) throw broken();
  const bool isByte = header.type == SampleType::Byte;
  void* out = nullptr;
  if (isByte) {
    image->bytes.resize(values);
    out = image->bytes.data();
  } else {
    image->floats.resize(values);
    image->integerFloats = !isFloatingPoint(header.type);
    out = image->floats.data();
  }
  if (!reader.readImage(image->channels, isByte ? SampleType::Byte : SampleType::Float, out)) throw broken();
  limitFloats(*image);
  return image;
}

}  // namespace

Texture::Texture(std::shared_ptr<const Image> image, bool srgb, Wrap wrapU, Wrap wrapV, Filter filter)
    : image_(std::move(image)), srgb_(srgb), wrapU_(wrapU), wrapV_(wrapV), filter_(filter) {
  BRAID_ASSERT(image_ && image_->width > 0 && image_->height > 0 && image_->channels >= 1 && image_->channels <= 4);
  if (srgb && image_->integerFloats) image_ = decodedFromSrgb(*image_);
  width_ = image_->width;
  height_ = image_->height;
  channels_ = image_->channels;
  if (!image_->bytes.empty()) {
    bytes_ = image_->bytes.data();
    colourTable_ = srgb ? byteTables().srgb.data() : byteTables().linear.data();
  } else {
    floats_ = image_->floats.data();
  }
}

template <class Texels>
inline Vec4 Texture::filtered(const Texels& texels, Vec2 uv) const {
  const auto stride = static_cast<size_t>(width_);
  if (filter_ == Filter::Nearest) {
    const auto row = static_cast<size_t>(nearestTap(uv.y, wrapV_, height_)) * stride;
    return texels(row + static_cast<size_t>(nearestTap(uv.x, wrapU_, width_)));
  }
  const Taps u = linearTaps(uv.x, wrapU_, width_), v = linearTaps(uv.y, wrapV_, height_);
  const size_t upper = static_cast<size_t>(v.first) * stride, lower = static_cast<size_t>(v.second) * stride;
  const auto left = static_cast<size_t>(u.first), right = static_cast<size_t>(u.second);
  const Vec4 a = texels(upper + left) * (1 - u.weight) + texels(upper + right) * u.weight;
  const Vec4 b = texels(lower + left) * (1 - u.weight) + texels(lower + right) * u.weight;
  return a * (1 - v.weight) + b * v.weight;
}

Vec4 Texture::sample(Vec2 uv) const {
  if (bytes_) {
    switch (channels_) {
      case 1:
        return filtered(ByteTexels<1>{bytes_, colourTable_}, uv);
      case 2:
        return filtered(ByteTexels<2>{bytes_, colourTable_}, uv);
      case 3:
        return filtered(ByteTexels<3>{bytes_, colourTable_}, uv);
      default:
        return filtered(ByteTexels<4>{bytes_, colourTable_}, uv);
    }
  }
  switch (channels_) {
    case 0:
      return Vec4(1);  // a texture without an image
    case 1:
      return filtered(FloatTexels<1>{floats_}, uv);
    case 2:
      return filtered(FloatTexels<2>{floats_}, uv);
    case 3:
      return filtered(FloatTexels<3>{floats_}, uv);
    default:
      return filtered(FloatTexels<4>{floats_}, uv);
  }
}

bool Texture::isBlack(const Spectrum& factor) const {
  constexpr int kDarkest = 2;
  const auto stride = static_cast<size_t>(channels_), colours = channels_ < 3 ? size_t(1) : size_t(3);
  const float least = image_->integerFloats ? kDarkest / 255.0f : 0.0f;
  const size_t count = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  for (size_t i = 0; i < count; ++i)
    for (size_t c = 0; c < colours; ++c) {
      const bool wanted = colours == 1 || factor[static_cast<int>(c)] > 0;
      if (wanted && (bytes_ ? bytes_[i * stride + c] > kDarkest : floats_[i * stride + c] > least)) return false;
    }
  return true;
}

size_t Texture::bytes() const { return image_ ? image_->bytes.size() + image_->floats.size() * sizeof(float) : 0; }

std::shared_ptr<const Image> decodeImage(const uint8_t* data, size_t bytes, const std::string& name) {
  if (bytes == 0) throw Error(ExitCode::BadInput, "is an empty image; save it again");
  if (isWebp(data, bytes)) return decodeWebp(data, bytes, name);
  if (isKtx2(data, bytes)) return decodeKtx2(data, bytes, name);
  const std::unique_ptr<ImageReader> reader = openReader(formatName(data, bytes), data, bytes);
  const std::shared_ptr<Image> image = readPixels(*reader, name, bytes);
  if (image->hasAlpha() && isAssociated(*reader)) divideByAlpha(*image);
  return image;
}

namespace {

// The decoder of formats that OpenImageIO does not read as they are meant; null for all others.
auto ownDecoder(const std::string& path) -> decltype(&decodeWebp) {
  std::array<char, 12> first{};
  std::ifstream in(path, std::ios::binary);
  if (!in.read(first.data(), first.size())) return nullptr;
  const auto* bytes = reinterpret_cast<const uint8_t*>(first.data());
  if (isWebp(bytes, first.size())) return decodeWebp;
  if (isKtx2(bytes, first.size())) return decodeKtx2;
  if (std::equal(first.begin() + 4, first.begin() + 8, "ftyp")) return decodeImage;
  return nullptr;
}

}  // namespace

std::shared_ptr<const Image> readImageFile(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    throw Error(ExitCode::BadInput, path + ": is not a file that can be read; check the path");
  try {
    if (const auto decode = ownDecoder(path)) {
      std::ifstream in(path, std::ios::binary);
      const std::string file{std::istreambuf_iterator<char>(in), {}};
      if (in.bad()) throw Error(ExitCode::BadInput, "cannot be read; check its permissions");
      return decode(reinterpret_cast<const uint8_t*>(file.data()), file.size(), path);
    }
    return readPixels(*openReader(path, nullptr, 0), path, std::filesystem::file_size(path, ignored));
  } catch (const Error& error) {
    // That the codecs cannot be opened is no fault of the file.
    if (error.code() != ExitCode::BadInput) throw;
    throw Error(error.code(), path + ": " + error.what());
  }
}

}  // namespace braid
