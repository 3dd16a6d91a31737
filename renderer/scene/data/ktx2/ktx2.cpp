// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/data/ktx2/ktx2.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "renderer/core/image_values.h"
#include "renderer/core/parallel.h"
#include "renderer/scene/data/ktx2/etc1s.h"
#include "renderer/scene/data/ktx2/plain.h"
#include "renderer/scene/data/ktx2/uastc.h"

namespace braid::ktx2 {

namespace {

// Which decoded channel, or which constant, is shown as red, green, blue and alpha: four of "rgba01".
using Shown = std::array<char, 4>;

Shown shownOfEtc1s(const std::vector<uint8_t>& channels) {
  constexpr uint8_t kRed = 3, kGreen = 4;
  const bool isRed = !channels.empty() && channels[0] == kRed;
  if (channels.size() < 2) return isRed ? Shown{'r', 'r', 'r', '1'} : Shown{'r', 'g', 'b', '1'};
  // The second slice is decoded into alpha, whatever it holds.
  if (isRed && channels[1] == kGreen) return {'r', 'a', '0', '1'};
  return isRed ? Shown{'r', 'r', 'r', 'a'} : Shown{'r', 'g', 'b', 'a'};
}

Shown shownOfUastc(const std::vector<uint8_t>& channels) {
  switch (channels.empty() ? 3 : channels[0]) {
    case 0:
      return {'r', 'g', 'b', '1'};
    case 4:
      return {'r', 'r', 'r', '1'};
    case 5:  // red in all colours, green in alpha
      return {'r', 'a', '0', '1'};
    case 6:
      return {'r', 'g', '0', '1'};
    default:
      return {'r', 'g', 'b', 'a'};
  }
}

Shown shownOfPlain(size_t channels) {
  constexpr std::array<Shown, 4> kByCount = {
      {{'r', '0', '0', '1'}, {'r', 'g', '0', '1'}, {'r', 'g', 'b', '1'}, {'r', 'g', 'b', 'a'}}};
  return kByCount[channels - 1];
}

constexpr std::string_view kChannelNames = "rgba";

Shown swizzled(const Shown& shown, const std::string& swizzle) {
  if (swizzle.empty()) return shown;
  Shown result;
  for (size_t i = 0; i < result.size(); ++i) {
    const size_t from = kChannelNames.find(swizzle[i]);
    result[i] = from == kChannelNames.npos ? swizzle[i] : shown[from];
  }
  return result;
}

// The channels that a picture needs of those shown.
std::vector<char> stored(const Shown& shown) {
  std::vector<char> channels(shown.begin(), shown.end());
  if (shown[3] == '1') channels.pop_back();
  if (shown[0] == shown[1] && shown[1] == shown[2]) channels.erase(channels.begin(), channels.begin() + 2);
  return channels;
}

// One row: channel c of texel x is from[c] of RGBA, or a constant. `step` is -4 where the row is to be turned around.
template <size_t count, class T>
void arrangeRow(const T* rgba, ptrdiff_t step, size_t width, const std::vector<char>& channels, T one, T* to) {
  std::array<ptrdiff_t, count> from{};
  std::array<T, count> constant{};
  bool isConstant = false;
  for (size_t c = 0; c < count; ++c) {
    const size_t channel = kChannelNames.find(channels[c]);
    isConstant |= channel == kChannelNames.npos;
    from[c] = channel == kChannelNames.npos ? -1 : static_cast<ptrdiff_t>(channel);
    constant[c] = channels[c] == '1' ? one : T(0);
  }
  for (size_t x = 0; x < width; ++x, to += count) {
    const T* texel = rgba + static_cast<ptrdiff_t>(x) * step;
    for (size_t c = 0; c < count; ++c) to[c] = isConstant && from[c] < 0 ? constant[c] : texel[from[c]];
  }
}

// From RGBA in the order of the file to the channels of the picture, upright.
template <class T>
std::vector<T> arranged(std::vector<T> rgba, const Container& file, const std::vector<char>& channels, T one) {
  if (!file.flipsX && !file.flipsY &&
      std::equal(channels.begin(), channels.end(), kChannelNames.begin(), kChannelNames.end()))
    return rgba;
  const size_t width = file.width, height = file.height, count = channels.size();
  constexpr std::array kArrange = {arrangeRow<1, T>, arrangeRow<2, T>, arrangeRow<3, T>, arrangeRow<4, T>};
  std::vector<T> out(width * height * count);
  parallelFor(height, [&](size_t y) {
    const T* row = rgba.data() + (file.flipsY ? height - 1 - y : y) * width * 4;
    kArrange[count - 1](file.flipsX ? row + (width - 1) * 4 : row, file.flipsX ? -4 : 4, width, channels, one,
                        &out[y * width * count]);
  });
  return out;
}

uint8_t dividedBy(uint8_t colour, uint8_t alpha) {
  return static_cast<uint8_t>(std::min(255, (colour * 255 + alpha / 2) / alpha));
}

float dividedBy(float colour, float alpha) { return colour / alpha; }

template <class T>
void divideByAlpha(T* rgba, size_t texels) {
  for (size_t i = 0; i < texels; ++i, rgba += 4)
    for (size_t c = 0; c < 3 && rgba[3] > 0; ++c) rgba[c] = dividedBy(rgba[c], rgba[3]);
}

void checkSize(const Container& container, size_t fileBytes) {
  // Flat pictures can be packed into a few bytes, so that those of usual sizes are believed.
  constexpr uint64_t kMostPixels = uint64_t(1) << 28, kBelieved = uint64_t(1) << 24;
  const std::string size = std::to_string(container.width) + " x " + std::to_string(container.height);
  const uint64_t pixels = uint64_t(container.width) * container.height;
  if (pixels > kMostPixels)
    throw Error(ExitCode::BadInput, "is an image of " + size + " pixels, more than 2^28; make it smaller");
  if (pixels > kBelieved && !canHold(fileBytes, pixels * 4))
    failBroken("it claims " + size + " pixels in " + std::to_string(fileBytes) + " bytes");
}

// The level as it is without its compression, at least so many bytes of it.
Bytes unpackedLevel(const Container& file, size_t bytes, std::vector<uint8_t>& holder) {
  if (file.scheme == Supercompression::None) return file.level;
  if (file.scheme == Supercompression::BasisLz) failUnsupported("of BasisLZ around other blocks than ETC1S");
  holder = inflate(file.scheme, file.level, bytes);
  return holder;
}

class Decoder {
 public:
  explicit Decoder(const Container& file) : file_(file), texels_(file.width * file.height) {}

  Picture run() {
    picture_.width = static_cast<int>(file_.width);
    picture_.height = static_cast<int>(file_.height);
    picture_.isSeveral = file_.isSeveral;
    picture_.srgb = file_.srgb;
    if (const std::optional<PlainFormat> format = plainFormat(file_.vkFormat)) {
      decodePlain(*format);
    } else if (file_.vkFormat != 0) {
      failUnsupported("in blocks of graphics cards (vkFormat " + std::to_string(file_.vkFormat) + ")");
    } else if (file_.model == ColourModel::Etc1s && file_.scheme == Supercompression::BasisLz) {
      const BasisLz basis(file_.globalData, file_.imageCount);
      ByteTexels decoded = decodeEtc1s(basis, file_.level, file_.width, file_.height);
      finish(std::move(decoded.rgba), shownOfEtc1s(file_.channels), picture_.bytes, uint8_t(255));
    } else if (file_.model == ColourModel::Uastc) {
      std::vector<uint8_t> holder;
      const size_t bytes = blocksAlong(file_.width) * blocksAlong(file_.height) * kUastcBlockBytes;
      const Bytes level = unpackedLevel(file_, bytes, holder);
      ByteTexels decoded = decodeUastc(level, file_.width, file_.height, file_.srgb);
      finish(std::move(decoded.rgba), shownOfUastc(file_.channels), picture_.bytes, uint8_t(255));
    } else {
      failUnsupported("of colour model " + std::to_string(static_cast<int>(file_.model)));
    }
    return std::move(picture_);
  }

 private:
  void decodePlain(const PlainFormat& format) {
    std::vector<uint8_t> holder;
    const Bytes level = unpackedLevel(file_, texels_ * format.texelBytes(), holder);
    picture_.srgb |= format.srgb;
    picture_.isInteger = format.sample == Sample::Short;
    const Shown shown = shownOfPlain(format.channels);
    if (format.sample == Sample::Byte) {
      finish(plainBytes(format, level, texels_), shown, picture_.bytes, uint8_t(255));
    } else {
      finish(plainFloats(format, level, texels_), shown, picture_.floats, 1.0f);
    }
  }

  template <class T>
  void finish(std::vector<T> rgba, const Shown& asStored, std::vector<T>& out, T one) {
    if (file_.premultiplied && asStored[3] == 'a') divideByAlpha(rgba.data(), texels_);
    const Shown shown = swizzled(asStored, file_.swizzle);
    const std::vector<char> channels = stored(shown);
    picture_.channels = static_cast<int>(channels.size());
    picture_.isRedGreen = shown[2] == '0' && shown[3] == '1' && shown[1] != '0' && shown[1] != '1';
    out = arranged(std::move(rgba), file_, channels, one);
  }

  const Container& file_;
  size_t texels_;
  Picture picture_;
};

}  // namespace

Picture decode(Bytes file) {
  const Container container = readContainer(file);
  checkSize(container, file.size());
  return Decoder(container).run();
}

}  // namespace braid::ktx2
