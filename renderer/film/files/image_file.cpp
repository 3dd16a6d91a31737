// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <new>
#include <set>
#include <system_error>
#include <vector>

#include "renderer/core/error.h"
#include "renderer/core/image_values.h"
#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/film/files/exr.h"
#include "renderer/images/image_codecs.h"

namespace braid {

namespace {

// What a file may declare before anything is allocated for it: 16k x 16k pixels, the channels of a large multilayer
// file, 16 GiB in all.
constexpr int kMaxChannels = 4096;
constexpr int64_t kMaxValues = int64_t(1) << 32;
constexpr int kRowsPerRead = 64;

[[noreturn]] void refuse(const std::string& path, const std::string& reason) {
  std::string line = reason;
  for (char& c : line)
    if (c == '\n' || c == '\r') c = ' ';
  throw Error(ExitCode::BadInput, path + ": " + line);
}

void checkSize(const std::string& path, uint64_t fileBytes, const ImageHeader& header) {
  const auto channels = static_cast<int64_t>(header.channels.size());
  const std::string size = std::to_string(header.width) + "x" + std::to_string(header.height);
  if (header.width <= 0 || header.height <= 0 || channels <= 0) refuse(path, "empty image (" + size + ")");
  if (header.deep) refuse(path, "deep images are not supported; flatten it first (oiiotool --flatten)");
  if (header.depth > 1) refuse(path, "volume images are not supported");
  const int64_t pixels = int64_t(header.width) * header.height;
  if (pixels > kMaxPixels) refuse(path, size + " pixels are more than the limit of 2^28; crop or resize it");
  if (channels > kMaxChannels || pixels * channels > kMaxValues)
    refuse(path, size + " pixels with " + std::to_string(channels) +
                     " channels are more than the limit (4096 channels, 2^32 values); remove some channels");
  if (!canHold(fileBytes, static_cast<uint64_t>(pixels * channels)))
    refuse(path, "claims " + size + " pixels in " + std::to_string(fileBytes) +
                     " bytes, which cannot be: it is damaged; use another copy");
}

bool startsLinear(const std::string& space) {
  constexpr const char* kLinear = "lin";
  for (size_t i = 0; i < 3; ++i)
    if (i >= space.size() || (space[i] | 0x20) != kLinear[i]) return false;
  return true;
}

// 8- and 16-bit formats hold sRGB unless they say otherwise; float formats are linear.
bool holdsSrgb(const ImageHeader& header) {
  if (isFloatingPoint(header.type)) return false;
  return !startsLinear(header.colourSpace) && header.colourSpace != "scene_linear";
}

// Reads one part, some rows at a time: never the whole file twice in memory.
void readPart(const std::string& path, ImageReader& in, std::vector<Plane<float>>& planes) {
  const ImageHeader& header = in.header();
  const size_t count = header.channels.size(), width = static_cast<size_t>(header.width);
  const int step = header.tileHeight > 0 ? header.tileHeight : kRowsPerRead;
  std::vector<float> rows(static_cast<size_t>(std::min(step, header.height)) * width * count);
  for (int y = 0; y < header.height; y += step) {
    const int end = std::min(y + step, header.height);
    if (!in.readRows(y, end, rows.data()))
      refuse(path, "cannot be read: " + in.takeError() + "; the file is damaged or incomplete");
    parallelRows(end - y, [&](int row) {
      for (size_t c = 0; c < count; ++c) {
        const float* from = rows.data() + static_cast<size_t>(row) * width * count + c;
        float* to = &planes[c].at(0, y + row);
        for (size_t x = 0; x < width; ++x) to[x] = from[x * count];
      }
    });
  }
}

const Plane<float>* alphaOf(const ImageHeader& header, const std::vector<Plane<float>>& planes) {
  const bool exists = header.alpha >= 0 && static_cast<size_t>(header.alpha) < planes.size();
  return exists ? &planes[static_cast<size_t>(header.alpha)] : nullptr;
}

// Colours to linear, premultiplied by alpha as everything else here is. `multiplied`: alpha is in the encoded colours
// already, where it does not belong.
void linearise(const ImageHeader& header, bool multiplied, std::vector<Plane<float>>& planes) {
  const Plane<float>* alpha = alphaOf(header, planes);
  for (Plane<float>& p : planes) {
    if (&p == alpha) continue;
    parallelChunks(p.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        const float a = alpha ? (*alpha)[i] : 1.0f, colour = multiplied && a > 0 ? std::min(p[i] / a, 1.0f) : p[i];
        p[i] = decodeSrgb(colour) * a;
      }
    });
  }
}

// Linear colours that alpha is not in yet.
void premultiply(const ImageHeader& header, std::vector<Plane<float>>& planes) {
  const Plane<float>* alpha = alphaOf(header, planes);
  if (!alpha) return;
  for (Plane<float>& p : planes)
    if (&p != alpha)
      for (size_t i = 0; i < p.size(); ++i) p[i] *= (*alpha)[i];
}

void addPart(ImageFile& file, ImageReader& in, int part) {
  const ImageHeader& header = in.header();
  if (part > 0 && (header.width != file.width || header.height != file.height)) return;  // a thumbnail or a mip level
  std::vector<Plane<float>> planes(header.channels.size(), Plane<float>(header.width, header.height));
  readPart(file.path, in, planes);
  // OpenImageIO's WebP reader multiplies whatever it is asked for.
  if (holdsSrgb(header))
    linearise(header, in.format() == "webp", planes);
  else if (header.unassociatedAlpha)
    premultiply(header, planes);
  const std::string partName = header.part.empty() ? "part" + std::to_string(part) : header.part;
  for (size_t c = 0; c < planes.size(); ++c) {
    std::string name = header.channels[c];
    if (file.planes.count(name)) name = partName + "." + name;
    if (file.planes.count(name)) continue;
    file.channelNames.push_back(name);
    file.planes.emplace(name, std::move(planes[c]));
  }
}

ImageFile readOpened(const std::string& path, uint64_t fileBytes, ImageReader& in) {
  const ImageHeader& header = in.header();
  ImageFile file;
  file.path = path;
  file.width = header.width;
  file.height = header.height;
  file.window = {header.x, header.y, header.x + header.width, header.y + header.height};
  file.fullWidth = header.fullWidth;
  file.fullHeight = header.fullHeight;
  file.attributes = header.attributes;
  int64_t values = 0;
  for (int part = 0; in.select(part); ++part) {
    checkSize(path, fileBytes, header);
    values += int64_t(header.width) * header.height * static_cast<int64_t>(header.channels.size());
    if (values > kMaxValues) refuse(path, "its parts hold more than the limit of 2^32 values; remove some");
    addPart(file, in, part);
  }
  return file;
}

// The three channel names that stand for a layer, or nothing.
std::vector<std::string> layerChannels(const ImageFile& file, const std::string& prefix) {
  const std::string dot = prefix.empty() ? "" : prefix + ".";
  static const char* const triples[][3] = {{"R", "G", "B"}, {"r", "g", "b"}, {"X", "Y", "Z"}, {"x", "y", "z"},
                                           {"Y", "Y", "Y"}, {"V", "V", "V"}, {"Z", "Z", "Z"}};
  for (const auto& t : triples) {
    std::vector<std::string> names;
    for (const char* name : t)
      if (file.planes.count(dot + name)) names.push_back(dot + name);
    if (names.size() == 3) return names;
  }
  if (prefix.empty() && file.channelNames.size() == 1) return std::vector<std::string>(3, file.channelNames[0]);
  return {};
}

}  // namespace

bool hasLayer(const ImageFile& file, const std::string& prefix) { return !layerChannels(file, prefix).empty(); }

Rgb<float> ImageFile::rgb(const std::string& prefix) const {
  const std::vector<std::string> names = layerChannels(*this, prefix);
  if (names.empty()) {
    std::set<std::string> layers;
    for (const std::string& n : channelNames)
      if (const size_t dot = n.rfind('.'); dot != std::string::npos && hasLayer(*this, n.substr(0, dot)))
        layers.insert(n.substr(0, dot));
    std::string list;
    for (const std::string& l : layers) list += (list.empty() ? "" : ", ") + l;
    const std::string wanted = prefix.empty() ? "R G B" : prefix + ".R " + prefix + ".G " + prefix + ".B";
    refuse(path, "no channels " + wanted + (list.empty() ? "; it has no colour layer" : "; its layers are " + list));
  }
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = planes.at(names[c]);
  return out;
}

ImageFile readImage(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) refuse(path, "no such file");
  if (std::filesystem::is_directory(path, ignored)) refuse(path, "is a folder, not an image");
  std::string error;
  const auto in = imageCodecs().open(path, error);
  if (!in) refuse(path, "cannot be read as an image: " + error);
  const uint64_t fileBytes = std::filesystem::file_size(path, ignored);
  checkSize(path, fileBytes, in->header());
  try {
    return readOpened(path, fileBytes, *in);
  } catch (const std::bad_alloc&) {
    throw Error(ExitCode::OutOfMemory, path + ": not enough memory to read it; crop or resize it");
  }
}

}  // namespace braid
