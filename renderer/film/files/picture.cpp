// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/picture.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <OpenImageIO/imageio.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/srgb.h"

namespace braid {

namespace {

struct Ending {
  const char* text;
  ImageFormat format;
};
constexpr Ending kEndings[] = {{".exr", ImageFormat::Exr},   {".png", ImageFormat::Png}, {".jpg", ImageFormat::Jpeg},
                               {".jpeg", ImageFormat::Jpeg}, {".hdr", ImageFormat::Hdr}, {".tif", ImageFormat::Tiff},
                               {".tiff", ImageFormat::Tiff}};

const char* pluginOf(ImageFormat format) {
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

void write(const std::string& path, ImageFormat format, const OIIO::ImageSpec& spec, const void* pixels) {
  const char* plugin = pluginOf(format);
  OutputFile file(path, std::string(".") + plugin);
  {
    const auto out = OIIO::ImageOutput::create(plugin);
    if (!out) file.fail(OIIO::geterror());
    if (!out->set_ioproxy(&file))
      file.fail("this OpenImageIO cannot write " + std::string(plugin) + " through a stream");
    if (!out->open(file.temporaryPath(), spec)) file.fail(out->geterror());
    if (!out->write_image(spec.format, pixels)) file.fail(out->geterror());
    if (!out->close()) file.fail(out->geterror());
  }
  file.finish();
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

std::vector<uint8_t> toneMapped(const Rgb<float>& image, const Plane<float>* alpha, float exposureStops) {
  const float scale = std::exp2(exposureStops);
  const size_t channels = alpha ? 4 : 3;
  std::vector<uint8_t> bytes(channels * image.size());
  // max before min: NaN becomes black.
  const auto clamped = [](float v) { return std::min(std::max(0.0f, v), 1.0f); };
  parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (size_t c = 0; c < 3; ++c) {
        const float v = alpha ? unassociated(image[c][i], (*alpha)[i]) : image[c][i];
        bytes[channels * i + c] = static_cast<uint8_t>(encodeSrgb(clamped(scale * v)) * 255 + 0.5f);
      }
      if (alpha) bytes[channels * i + 3] = static_cast<uint8_t>(clamped((*alpha)[i]) * 255 + 0.5f);
    }
  });
  return bytes;
}

void writePicture(const std::string& path, ImageFormat format, const Rgb<float>& image, const Plane<float>* alpha,
                  float exposureStops) {
  BRAID_ASSERT(!image.empty() && format != ImageFormat::Exr);
  const bool forEyes = format == ImageFormat::Png || format == ImageFormat::Jpeg;
  if (format == ImageFormat::Jpeg || format == ImageFormat::Hdr) alpha = nullptr;
  OIIO::ImageSpec spec(image.width(), image.height(), alpha ? 4 : 3,
                       forEyes ? OIIO::TypeDesc::UINT8 : OIIO::TypeDesc::FLOAT);
  spec.attribute("oiio:ColorSpace", forEyes ? "sRGB" : "Linear");
  // OpenImageIO adds the date of writing when there is none; files must reproduce byte for byte.
  spec.attribute("DateTime", "");
  if (alpha) spec.attribute("oiio:UnassociatedAlpha", 1);
  // Half the time of the usual level 6, for a hundredth more bytes.
  if (format == ImageFormat::Png) spec.attribute("png:compressionLevel", 4);
  if (format == ImageFormat::Jpeg) spec.attribute("CompressionQuality", 95);
  if (format == ImageFormat::Tiff) spec.attribute("compression", "zip");
  if (forEyes)
    write(path, format, spec, toneMapped(image, alpha, exposureStops).data());
  else
    write(path, format, spec, linear(image, alpha).data());
}

}  // namespace braid
