// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <new>
#include <set>
#include <system_error>
#include <vector>

#include <OpenImageIO/imageio.h>

#include "renderer/core/error.h"
#include "renderer/core/image_limits.h"
#include "renderer/core/parallel.h"
#include "renderer/core/plane.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/files/srgb.h"

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

void checkSize(const std::string& path, uint64_t fileBytes, const OIIO::ImageSpec& spec) {
  const std::string size = std::to_string(spec.width) + "x" + std::to_string(spec.height);
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0) refuse(path, "empty image (" + size + ")");
  if (spec.deep) refuse(path, "deep images are not supported; flatten it first (oiiotool --flatten)");
  if (spec.depth > 1) refuse(path, "volume images are not supported");
  const int64_t pixels = int64_t(spec.width) * spec.height;
  if (pixels > kMaxPixels) refuse(path, size + " pixels are more than the limit of 2^28; crop or resize it");
  if (spec.nchannels > kMaxChannels || pixels * spec.nchannels > kMaxValues)
    refuse(path, size + " pixels with " + std::to_string(spec.nchannels) +
                     " channels are more than the limit (4096 channels, 2^32 values); remove some channels");
  if (!canHold(fileBytes, static_cast<uint64_t>(pixels * spec.nchannels)))
    refuse(path, "claims " + size + " pixels in " + std::to_string(fileBytes) +
                     " bytes, which cannot be: it is damaged; use another copy");
}

// 8- and 16-bit formats hold sRGB unless they say otherwise; float formats are linear.
bool holdsSrgb(const OIIO::ImageSpec& spec) {
  const auto base = spec.format.basetype;
  if (base == OIIO::TypeDesc::HALF || base == OIIO::TypeDesc::FLOAT || base == OIIO::TypeDesc::DOUBLE) return false;
  const std::string space(spec.get_string_attribute("oiio:ColorSpace", "sRGB"));
  return !OIIO::Strutil::istarts_with(space, "lin") && space != "scene_linear";
}

Attribute toAttribute(const OIIO::ParamValue& p) {
  using OIIO::TypeDesc;
  Attribute a;
  a.name = p.name().string();
  const TypeDesc type = p.type();
  const auto floats = [&p](size_t count) {
    const auto* f = static_cast<const float*>(p.data());
    return std::vector<float>(f, f + count);
  };
  if (type == TypeDesc::TypeMatrix) {
    a.kind = Attribute::Kind::Matrix;
    a.values = floats(16);
  } else if (type == TypeDesc(TypeDesc::FLOAT, 8)) {
    a.kind = Attribute::Kind::Chromaticities;
    a.values = floats(8);
  } else if (type == TypeDesc::TypeInt) {
    a.kind = Attribute::Kind::Int;
    a.integer = p.get_int();
  } else if (type == TypeDesc::TypeFloat) {
    a.kind = Attribute::Kind::Float;
    a.number = static_cast<double>(p.get_float());
  } else {
    a.text = p.get_string();
  }
  return a;
}

// Reads one part, some rows at a time: never the whole file twice in memory.
void readPart(const std::string& path, OIIO::ImageInput& in, int part, std::vector<Plane<float>>& planes) {
  const OIIO::ImageSpec spec = in.spec(part);
  const auto count = static_cast<size_t>(spec.nchannels), width = static_cast<size_t>(spec.width);
  const int step = spec.tile_height > 0 ? spec.tile_height : kRowsPerRead;
  std::vector<float> rows(static_cast<size_t>(std::min(step, spec.height)) * width * count);
  for (int y = 0; y < spec.height; y += step) {
    const int begin = spec.y + y, end = std::min(begin + step, spec.y + spec.height);
    const bool ok =
        spec.tile_width > 0
            ? in.read_tiles(part, 0, spec.x, spec.x + spec.width, begin, end, spec.z, spec.z + 1, 0, spec.nchannels,
                            OIIO::TypeDesc::FLOAT, rows.data())
            : in.read_scanlines(part, 0, begin, end, spec.z, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, rows.data());
    if (!ok) refuse(path, "cannot be read: " + in.geterror() + "; the file is damaged or incomplete");
    parallelRows(end - begin, [&](int row) {
      for (size_t c = 0; c < count; ++c) {
        const float* from = rows.data() + static_cast<size_t>(row) * width * count + c;
        float* to = &planes[c].at(0, y + row);
        for (size_t x = 0; x < width; ++x) to[x] = from[x * count];
      }
    });
  }
}

// Colours to linear, premultiplied by alpha as everything else here is. `multiplied`: alpha is in the encoded colours
// already, where it does not belong.
void linearise(const OIIO::ImageSpec& spec, bool multiplied, std::vector<Plane<float>>& planes) {
  const bool hasAlpha = spec.alpha_channel >= 0 && spec.alpha_channel < spec.nchannels;
  const Plane<float>* alpha = hasAlpha ? &planes[static_cast<size_t>(spec.alpha_channel)] : nullptr;
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
void premultiply(const OIIO::ImageSpec& spec, std::vector<Plane<float>>& planes) {
  if (spec.alpha_channel < 0 || spec.alpha_channel >= spec.nchannels) return;
  const Plane<float>& alpha = planes[static_cast<size_t>(spec.alpha_channel)];
  for (Plane<float>& p : planes)
    if (&p != &alpha)
      for (size_t i = 0; i < p.size(); ++i) p[i] *= alpha[i];
}

void addPart(ImageFile& file, OIIO::ImageInput& in, int part) {
  const OIIO::ImageSpec spec = in.spec(part);
  if (part > 0 && (spec.width != file.width || spec.height != file.height)) return;  // a thumbnail or a mip level
  std::vector<Plane<float>> planes(static_cast<size_t>(spec.nchannels), Plane<float>(spec.width, spec.height));
  readPart(file.path, in, part, planes);
  // OpenImageIO's WebP reader multiplies whatever it is asked for.
  if (holdsSrgb(spec))
    linearise(spec, std::string_view(in.format_name()) == "webp", planes);
  else if (spec.get_int_attribute("oiio:UnassociatedAlpha") != 0)
    premultiply(spec, planes);
  const std::string partName = spec.get_string_attribute("oiio:subimagename", "part" + std::to_string(part));
  for (int c = 0; c < spec.nchannels; ++c) {
    std::string name = spec.channel_name(c);
    if (file.planes.count(name)) name = partName + "." + name;
    if (file.planes.count(name)) continue;
    file.channelNames.push_back(name);
    file.planes.emplace(name, std::move(planes[static_cast<size_t>(c)]));
  }
}

ImageFile readOpened(const std::string& path, uint64_t fileBytes, OIIO::ImageInput& in) {
  const OIIO::ImageSpec first = in.spec();
  ImageFile file;
  file.path = path;
  file.width = first.width;
  file.height = first.height;
  file.window = {first.x, first.y, first.x + first.width, first.y + first.height};
  file.fullWidth = first.full_width;
  file.fullHeight = first.full_height;
  for (const OIIO::ParamValue& p : first.extra_attribs) file.attributes.push_back(toAttribute(p));
  int64_t values = 0;
  for (int part = 0; in.seek_subimage(part, 0); ++part) {
    checkSize(path, fileBytes, in.spec());
    values += int64_t(in.spec().width) * in.spec().height * in.spec().nchannels;
    if (values > kMaxValues) refuse(path, "its parts hold more than the limit of 2^32 values; remove some");
    addPart(file, in, part);
  }
  in.geterror();  // the seek past the last part
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
  OIIO::ImageSpec hints;
  hints.attribute("oiio:UnassociatedAlpha", 1);  // sRGB has to be decoded before colours are multiplied by alpha
  const auto in = OIIO::ImageInput::open(path, &hints);
  if (!in) refuse(path, "cannot be read as an image: " + OIIO::geterror());
  const uint64_t fileBytes = std::filesystem::file_size(path, ignored);
  checkSize(path, fileBytes, in->spec());
  try {
    return readOpened(path, fileBytes, *in);
  } catch (const std::bad_alloc&) {
    throw Error(ExitCode::OutOfMemory, path + ": not enough memory to read it; crop or resize it");
  }
}

}  // namespace braid
