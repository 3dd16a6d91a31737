// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/picture.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/output_file.h"
#include "renderer/core/image_values.h"
#include "renderer/film/make_attribute.h"
#include "renderer/images/image_codecs.h"

namespace braid {

namespace {

struct Ending {
  const char* text;
  ImageFormat format;
};
constexpr Ending kEndings[] = {{".exr", ImageFormat::Exr},   {".png", ImageFormat::Png}, {".jpg", ImageFormat::Jpeg},
                               {".jpeg", ImageFormat::Jpeg}, {".hdr", ImageFormat::Hdr}, {".tif", ImageFormat::Tiff},
                               {".tiff", ImageFormat::Tiff}};

const char* formatName(ImageFormat format) {
  return format == ImageFormat::Png    ? "png"
         : format == ImageFormat::Jpeg ? "jpeg"
         : format == ImageFormat::Hdr  ? "hdr"
                                       : "tiff";
}

// What a channel was before it was multiplied by alpha.
float unassociated(float value, float alpha) { return alpha > 0 ? value / alpha : 0.0f; }

// Three or four channels of floats, interleaved; alpha not multiplied into the colours.
std::vector<float> linear(const Rgb<float>& image, const Plane<float>* alpha) {
  const size_t channels = alpha ? 4 : 3;
  std::vector<float> values(channels * image.size());
  parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < 3; ++c)
        values[channels * i + c] = alpha ? unassociated(image[c][i], (*alpha)[i]) : image[c][i];
      if (alpha) values[channels * i + 3] = (*alpha)[i];
    }
  });
  return values;
}

void write(const std::string& path, ImageFormat format, const ImageHeader& header, const void* pixels) {
  const char* name = formatName(format);
  const ImageCodecs& codecs = imageCodecs();
  OutputFile file(path, std::string(".") + name);
  std::string error;
  {
    const auto out = codecs.create(name, file.temporaryPath(), header, file, error);
    if (!out) file.fail(error);
    if (!out->writeImage(pixels) || !out->close()) file.fail(out->takeError());
  }
  file.finish();
}

std::vector<Attribute> attributesOf(ImageFormat format, bool alpha) {
  const bool forEyes = isForDisplay(format);
  std::vector<Attribute> list{textAttribute("oiio:ColorSpace", forEyes ? "sRGB" : "Linear")};
  // OpenImageIO adds the date of writing when there is none; files must reproduce byte for byte.
  list.push_back(textAttribute("DateTime", ""));
  if (alpha) list.push_back(wholeAttribute("oiio:UnassociatedAlpha", 1));
  // Half the time of the usual level 6, for a hundredth more bytes.
  if (format == ImageFormat::Png) list.push_back(wholeAttribute("png:compressionLevel", 4));
  if (format == ImageFormat::Jpeg) list.push_back(wholeAttribute("CompressionQuality", 95));
  if (format == ImageFormat::Tiff) list.push_back(textAttribute("compression", "zip"));
  return list;
}

}  // namespace

ImageFormat imageFormat(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string(), known;
  for (char& c : ending)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  for (const Ending& e : kEndings) {
    if (ending == e.text) return e.format;
    known += (known.empty() ? "" : ", ") + std::string(e.text);
  }
  if (isStream(path)) return ImageFormat::Exr;
  throw Error(ExitCode::Usage, path + ": the ending says the format of an image, and " +
                                   (ending.empty() ? "there is none" : "'" + ending + "' is not known") +
                                   ": known are " + known);
}

bool isForDisplay(ImageFormat format) { return format == ImageFormat::Png || format == ImageFormat::Jpeg; }

std::vector<uint8_t> toneMapped(const Rgb<float>& image, const Plane<float>* alpha, const Tone& tone) {
  const float scale = std::exp2(tone.exposureStops);
  const size_t channels = alpha ? 4 : 3;
  std::vector<uint8_t> bytes(channels * image.size());
  const auto byteOf = [](float v) { return static_cast<uint8_t>(std::min(std::max(0.0f, v), 1.0f) * 255 + 0.5f); };
  parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      Vec3 v = image.pixel(i);
      for (int c = 0; c < 3 && alpha; ++c) v[c] = unassociated(v[c], (*alpha)[i]);
      const Vec3 shown = toDisplay(tone.curve, scale * v);
      for (int c = 0; c < 3; ++c) bytes[channels * i + static_cast<size_t>(c)] = byteOf(shown[c]);
      if (alpha) bytes[channels * i + 3] = byteOf((*alpha)[i]);
    }
  });
  return bytes;
}

void writePicture(const std::string& path, ImageFormat format, const Rgb<float>& image, const Plane<float>* alpha,
                  const Tone& tone) {
  BRAID_ASSERT(!image.empty() && format != ImageFormat::Exr);
  const bool forEyes = isForDisplay(format);
  if (format == ImageFormat::Jpeg || format == ImageFormat::Hdr) alpha = nullptr;
  ImageHeader header;
  header.width = image.width();
  header.height = image.height();
  header.type = forEyes ? SampleType::Byte : SampleType::Float;
  header.channels = {"R", "G", "B"};
  if (alpha) {
    header.channels.emplace_back("A");
    header.alpha = 3;
  }
  header.attributes = attributesOf(format, alpha != nullptr);
  if (forEyes)
    write(path, format, header, toneMapped(image, alpha, tone).data());
  else
    write(path, format, header, linear(image, alpha).data());
}

}  // namespace braid
