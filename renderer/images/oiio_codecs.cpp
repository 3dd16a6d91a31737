// SPDX-License-Identifier: Apache-2.0
// imageCodecs() by OpenImageIO: the only file of braid that knows it.
#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include "renderer/images/avif_reader.h"
#include "renderer/images/image_codecs.h"

namespace braid {

namespace {

using OIIO::TypeDesc;

TypeDesc toOiio(SampleType type) {
  switch (type) {
    case SampleType::Byte:
      return TypeDesc::UINT8;
    case SampleType::LargerInteger:
      return TypeDesc::UINT16;
    case SampleType::Half:
      return TypeDesc::HALF;
    case SampleType::Float:
      return TypeDesc::FLOAT;
    case SampleType::Double:
      break;
  }
  return TypeDesc::DOUBLE;
}

SampleType fromOiio(TypeDesc type) {
  if (type == TypeDesc::UINT8) return SampleType::Byte;
  if (type.basetype == TypeDesc::HALF) return SampleType::Half;
  if (type.basetype == TypeDesc::FLOAT) return SampleType::Float;
  if (type.basetype == TypeDesc::DOUBLE) return SampleType::Double;
  return SampleType::LargerInteger;
}

Attribute toAttribute(const OIIO::ParamValue& p) {
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

void addAttribute(OIIO::ImageSpec& spec, const Attribute& a) {
  switch (a.kind) {
    case Attribute::Kind::String:
      spec.attribute(a.name, a.text);
      break;
    case Attribute::Kind::Int:
      // EXR integers have 32 bits; a larger one (a seed, a count of samples) is kept exactly, as text.
      if (a.integer >= std::numeric_limits<int>::min() && a.integer <= std::numeric_limits<int>::max())
        spec.attribute(a.name, static_cast<int>(a.integer));
      else
        spec.attribute(a.name, std::to_string(a.integer));
      break;
    case Attribute::Kind::Float:
      spec.attribute(a.name, static_cast<float>(a.number));
      break;
    case Attribute::Kind::Matrix:
      spec.attribute(a.name, TypeDesc::TypeMatrix, a.values.data());
      break;
    case Attribute::Kind::Chromaticities:
      spec.attribute(a.name, TypeDesc(TypeDesc::FLOAT, 8), a.values.data());
      break;
  }
}

ImageHeader toHeader(const OIIO::ImageSpec& spec) {
  ImageHeader h;
  h.width = spec.width;
  h.height = spec.height;
  h.depth = spec.depth;
  h.x = spec.x;
  h.y = spec.y;
  h.fullWidth = spec.full_width;
  h.fullHeight = spec.full_height;
  h.type = fromOiio(spec.format);
  h.channels.reserve(static_cast<size_t>(std::max(0, spec.nchannels)));
  for (int c = 0; c < spec.nchannels; ++c) h.channels.emplace_back(spec.channel_name(c));
  h.alpha = spec.alpha_channel;
  for (const OIIO::ParamValue& p : spec.extra_attribs) h.attributes.push_back(toAttribute(p));
  h.deep = spec.deep;
  h.unassociatedAlpha = spec.get_int_attribute("oiio:UnassociatedAlpha") != 0;
  h.tileHeight = spec.tile_width > 0 ? spec.tile_height : 0;
  h.part = spec.get_string_attribute("oiio:subimagename");
  h.colourSpace = spec.get_string_attribute("oiio:ColorSpace");
  return h;
}

OIIO::ImageSpec toSpec(const ImageHeader& h) {
  OIIO::ImageSpec spec(h.width, h.height, static_cast<int>(h.channels.size()), toOiio(h.type));
  spec.channelnames = h.channels;
  for (const SampleType type : h.channelTypes) spec.channelformats.push_back(toOiio(type));
  if (h.alpha >= 0) spec.alpha_channel = h.alpha;
  spec.x = h.x;
  spec.y = h.y;
  if (h.fullWidth > 0) spec.full_width = h.fullWidth;
  if (h.fullHeight > 0) spec.full_height = h.fullHeight;
  for (const Attribute& a : h.attributes) addAttribute(spec, a);
  return spec;
}

// OpenImageIO's own reader of memory copies from beyond its end when a file sends it there.
class BoundedReader : public OIIO::Filesystem::IOMemReader {
 public:
  using IOMemReader::IOMemReader;
  size_t read(void* to, size_t most) override {
    const size_t count = pread(to, most, m_pos);
    m_pos += static_cast<int64_t>(count);
    return count;
  }
  size_t pread(void* to, size_t most, int64_t offset) override {
    if (offset < 0 || static_cast<uint64_t>(offset) >= size()) return 0;
    const size_t at = static_cast<size_t>(offset), count = std::min(most, size() - at);
    std::memcpy(to, m_buf.data() + at, count);
    return count;
  }
};

class SinkProxy : public OIIO::Filesystem::IOProxy {
 public:
  SinkProxy(const std::string& name, ByteSink& sink) : IOProxy(name, IOProxy::Write), sink_(sink) {}
  const char* proxytype() const override { return "braid"; }
  size_t write(const void* data, size_t size) override { return sink_.write(data, size); }
  size_t pwrite(const void* data, size_t size, int64_t offset) override {
    const int64_t here = sink_.tell();
    if (!sink_.seek(offset)) return 0;
    const size_t written = sink_.write(data, size);
    sink_.seek(here);
    return written;
  }
  bool seek(int64_t offset) override { return sink_.seek(offset); }
  int64_t tell() override { return sink_.tell(); }
  size_t size() const override { return sink_.size(); }

 private:
  ByteSink& sink_;
};

class Reader : public ImageReader {
 public:
  Reader(std::unique_ptr<BoundedReader> memory, std::unique_ptr<OIIO::ImageInput> input)
      : memory_(std::move(memory)), input_(std::move(input)), header_(toHeader(input_->spec())) {}

  std::string format() const override { return input_->format_name(); }

  bool select(int part) override {
    if (!input_->seek_subimage(part, 0)) return false;
    header_ = toHeader(input_->spec());
    return true;
  }

  const ImageHeader& header() const override { return header_; }

  bool readRows(int begin, int end, float* samples) override {
    const OIIO::ImageSpec& spec = input_->spec();
    const int part = input_->current_subimage();
    begin += spec.y;
    end += spec.y;
    if (spec.tile_width > 0)
      return input_->read_tiles(part, 0, spec.x, spec.x + spec.width, begin, end, spec.z, spec.z + 1, 0, spec.nchannels,
                                TypeDesc::FLOAT, samples);
    return input_->read_scanlines(part, 0, begin, end, spec.z, 0, spec.nchannels, TypeDesc::FLOAT, samples);
  }

  bool readImage(int channels, SampleType type, void* samples) override {
    return input_->read_image(0, 0, 0, channels, toOiio(type), samples);
  }

  std::string takeError() override { return input_->geterror(); }

 private:
  const std::unique_ptr<BoundedReader> memory_;
  const std::unique_ptr<OIIO::ImageInput> input_;
  ImageHeader header_;
};

class Writer : public ImageWriter {
 public:
  Writer(std::unique_ptr<SinkProxy> proxy, std::unique_ptr<OIIO::ImageOutput> output, TypeDesc type)
      : proxy_(std::move(proxy)), output_(std::move(output)), type_(type) {}

  bool writeRows(int begin, int end, const void* samples) override {
    const int first = output_->spec().y;
    return output_->write_scanlines(first + begin, first + end, 0, TypeDesc::UNKNOWN, samples);
  }
  bool writeImage(const void* samples) override { return output_->write_image(type_, samples); }
  bool close() override { return output_->close(); }
  std::string takeError() override { return output_->geterror(); }

 private:
  const std::unique_ptr<SinkProxy> proxy_;
  const std::unique_ptr<OIIO::ImageOutput> output_;
  const TypeDesc type_;
};

// Alpha belongs into linear colours only: it must not be multiplied into encoded ones.
OIIO::ImageSpec readingHints() {
  OIIO::ImageSpec hints;
  hints.attribute("oiio:UnassociatedAlpha", 1);
  return hints;
}

class OiioCodecs : public ImageCodecs {
 public:
  std::unique_ptr<ImageReader> open(const std::string& path, std::string& error) const override {
    const OIIO::ImageSpec hints = readingHints();
    auto input = OIIO::ImageInput::open(path, &hints);
    if (input) return std::make_unique<Reader>(nullptr, std::move(input));
    error = OIIO::geterror();
    return nullptr;
  }

  std::unique_ptr<ImageReader> openNamed(const std::string& name, const uint8_t* data, size_t bytes,
                                         std::string& error) const override {
    if (data && isAvif(data, bytes)) return openAvif(data, bytes, error);
    const OIIO::ImageSpec hints = readingHints();
    auto memory = data ? std::make_unique<BoundedReader>(data, bytes) : nullptr;
    auto input = OIIO::ImageInput::create(name, false, &hints, memory.get());
    if (!input || (memory && !input->supports("ioproxy"))) {
      error = "no such format; " + OIIO::geterror();
      return nullptr;
    }
    if (memory) input->set_ioproxy(memory.get());
    OIIO::ImageSpec spec;
    if (input->open(name, spec, hints)) return std::make_unique<Reader>(std::move(memory), std::move(input));
    error = input->geterror();
    return nullptr;
  }

  std::unique_ptr<ImageWriter> create(const std::string& format, const std::string& name, const ImageHeader& header,
                                      ByteSink& sink, std::string& error) const override {
    auto output = OIIO::ImageOutput::create(format);
    auto proxy = std::make_unique<SinkProxy>(name, sink);
    if (!output)
      error = OIIO::geterror();
    else if (!output->supports("ioproxy") || !output->set_ioproxy(proxy.get()))
      error = "this OpenImageIO cannot write " + format + " through a stream";
    else if (!output->open(name, toSpec(header)))
      error = output->geterror();
    else
      return std::make_unique<Writer>(std::move(proxy), std::move(output), toOiio(header.type));
    return nullptr;
  }
};

}  // namespace

const ImageCodecs& imageCodecs() {
  static const OiioCodecs codecs;
  return codecs;
}

}  // namespace braid
