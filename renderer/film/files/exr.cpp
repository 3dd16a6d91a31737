// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/exr.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/exr_rows.h"
#include "renderer/film/files/output_file.h"

namespace braid {

namespace {

constexpr float kHalfMax = 65504;

using Names = std::array<const char*, 3>;
constexpr Names kColour = {"R", "G", "B"};
constexpr Names kVector = {"X", "Y", "Z"};

// The channels of a file, all of one size.
class ChannelList {
 public:
  ChannelList(int width, int height, std::string prefix) : width_(width), height_(height), prefix_(std::move(prefix)) {
    if (!prefix_.empty()) prefix_ += '.';
  }

  void addHeadline(const char* name, const Plane<float>& plane, bool half) {
    check(plane);
    list_.push_back({name, &plane, half});
  }
  // Layers without planes are left out: not every estimate has quarters.
  void add(const std::string& name, const Plane<float>& plane) {
    if (plane.empty()) return;
    check(plane);
    list_.push_back({prefix_ + name, &plane, half_});
  }
  // Whether what is added from now on has half floats.
  void setHalf(bool half) { half_ = half; }
  void add(const std::string& layer, const Names& names, const Rgb<float>& planes) {
    for (size_t c = 0; c < 3; ++c) add(layer + "." + names[c], planes[c]);
  }
  void add(const std::string& layer, const char* name, const Plane<float>& plane) { add(layer + "." + name, plane); }

  std::vector<ExrChannel> list() const { return list_; }

 private:
  void check(const Plane<float>& plane) const { BRAID_ASSERT(plane.width == width_ && plane.height == height_); }

  int width_, height_;
  std::string prefix_;
  bool half_ = false;
  std::vector<ExrChannel> list_;
};

template <class P, class N>
void addFeature(ChannelList& channels, const std::string& layer, const N& names, const FeaturePlanes<P>& f, bool all) {
  channels.add(layer, names, f.mean);
  if (!all) return;
  channels.add(layer + "A", names, f.half[0]);
  channels.add(layer + "B", names, f.half[1]);
  channels.add(layer + "Variance", names, f.variance);
}

void addEstimate(ChannelList& channels, const Estimate& e, const ExrOptions& options) {
  channels.add(e.name + ".mean", kColour, e.mean);
  channels.add(e.name + ".halfA", kColour, e.half[0]);
  channels.add(e.name + ".halfB", kColour, e.half[1]);
  channels.add(e.name + ".variance", kColour, e.variance);
  channels.add(e.name + ".bias", kColour, e.bias);
  channels.add(e.name + ".biasA", kColour, e.biasHalf[0]);
  channels.add(e.name + ".biasB", kColour, e.biasHalf[1]);
  channels.add(e.name + ".biasVariance", kColour, e.biasVariance);
  if (options.directIndirect) {
    channels.add(e.name + ".direct", kColour, e.direct.mean);
    channels.add(e.name + ".directA", kColour, e.direct.half[0]);
    channels.add(e.name + ".directB", kColour, e.direct.half[1]);
    channels.add(e.name + ".directVariance", kColour, e.direct.variance);
    channels.add(e.name + ".indirectVariance", kColour, e.indirectVariance);
  }
  if (!options.quarters) return;
  for (size_t q = 0; q < e.quarter.size(); ++q) channels.add(e.name + ".q" + std::to_string(q), kColour, e.quarter[q]);
}

}  // namespace

std::vector<ExrChannel> namedPlanes(const Estimates& estimates, const Rgb<float>& headline, const Plane<float>* alpha,
                                    const ExrOptions& options) {
  ChannelList channels(headline.width(), headline.height(), options.layerPrefix);
  const bool half = !options.floatHeadline;
  for (size_t c = 0; c < 3; ++c) channels.addHeadline(kColour[c], headline[c], half);
  if (alpha) channels.addHeadline("A", *alpha, half);
  const bool all = options.aovs == AovSet::All;
  if (options.aovs != AovSet::None && estimates.features) {
    const Features& f = *estimates.features;
    channels.setHalf(!all && half);
    addFeature(channels, "Albedo", kColour, f.albedo, all);
    addFeature(channels, "N", kVector, f.normal, all);
    addFeature(channels, "Visibility", "V", f.visibility, all);
    channels.setHalf(false);  // metres may be any
    addFeature(channels, "Depth", "Z", f.depth, all);
  }
  if (options.aovs == AovSet::Features)
    for (const ExrLayer& layer : options.layers)
      if (layer.name == "Error" && layer.plane) channels.add(layer.name, "Y", *layer.plane);
  if (!all) return channels.list();
  for (const Estimate& e : estimates.estimates) {
    addEstimate(channels, e, options);
    const auto history = estimates.history.find(e.name);
    if (!options.history || history == estimates.history.end()) continue;
    for (const Checkpoint& c : history->second) {
      const std::string passes = std::to_string(c.passes);
      channels.add(e.name + ".variance" + passes, kColour, c.variance);
      channels.add(e.name + ".mean" + passes, kColour, c.mean);
      channels.add(e.name + ".halfA" + passes, kColour, c.half[0]);
      channels.add(e.name + ".halfB" + passes, kColour, c.half[1]);
    }
  }
  for (const ExrLayer& layer : options.layers) {
    if (layer.planes) channels.add(layer.name, kColour, *layer.planes);
    if (layer.plane) channels.add(layer.name, "Y", *layer.plane);
  }
  return channels.list();
}

namespace {

void addAttribute(OIIO::ImageSpec& spec, const Attribute& a) {
  using OIIO::TypeDesc;
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
      BRAID_ASSERT(a.values.size() == 16);
      spec.attribute(a.name, TypeDesc::TypeMatrix, a.values.data());
      break;
    case Attribute::Kind::Chromaticities:
      BRAID_ASSERT(a.values.size() == 8);
      spec.attribute(a.name, TypeDesc(TypeDesc::FLOAT, 8), a.values.data());
      break;
  }
}

OIIO::ImageSpec makeSpec(const Estimates& estimates, const std::vector<ExrChannel>& channels) {
  using OIIO::TypeDesc;
  const int width = channels[0].plane->width, height = channels[0].plane->height;
  OIIO::ImageSpec spec(width, height, static_cast<int>(channels.size()), TypeDesc::FLOAT);
  spec.channelnames.clear();
  for (const ExrChannel& c : channels) {
    spec.channelnames.push_back(c.name);
    spec.channelformats.push_back(c.half ? TypeDesc::HALF : TypeDesc::FLOAT);
    if (c.name == "A") spec.alpha_channel = static_cast<int>(spec.channelnames.size()) - 1;
  }
  if (estimates.window.width() > 0) {
    BRAID_ASSERT(estimates.window.width() == width && estimates.window.height() == height);
    spec.x = estimates.window.x0;
    spec.y = estimates.window.y0;
  }
  spec.full_width = estimates.fullWidth > 0 ? estimates.fullWidth : width;
  spec.full_height = estimates.fullHeight > 0 ? estimates.fullHeight : height;

  spec.attribute("compression", "zip:1");
  // OpenImageIO adds the date of writing when there is none; files must reproduce byte for byte, and an empty date is
  // the way to have none.
  spec.attribute("DateTime", "");
  const float rec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};  // R, G, B, white D65: x, y
  spec.attribute("chromaticities", TypeDesc(TypeDesc::FLOAT, 8), rec709);
  spec.attribute("colorInteropID", "lin_rec709_scene");
  spec.attribute("braid/varianceIs", "variance of the pixel mean");
  for (const Attribute& a : estimates.attributes) addAttribute(spec, a);
  return spec;
}

size_t bytesOf(const ExrChannel& channel) { return channel.half ? sizeof(half) : sizeof(float); }

// Copies a row of a plane to every `stride`-th byte; returns how many values had to be clamped to the range of half
// floats.
uint64_t interleaveRow(const ExrChannel& channel, int y, size_t stride, std::byte* to) {
  const auto width = static_cast<size_t>(channel.plane->width);
  const float* in = &channel.plane->at(0, y);
  if (!channel.half) {
    for (size_t x = 0; x < width; ++x) std::memcpy(to + x * stride, in + x, sizeof(float));
    return 0;
  }
  uint64_t clamped = 0;
  for (size_t x = 0; x < width; ++x) {
    const bool large = std::fabs(in[x]) > kHalfMax;
    const half value(large ? std::copysign(kHalfMax, in[x]) : in[x]);
    std::memcpy(to + x * stride, &value, sizeof(half));
    clamped += large;
  }
  return clamped;
}

// Copies rows [begin, end) of all planes, interleaved and in the types of the file: what OpenImageIO would have to
// convert it copies value by value, on one thread. Returns how many values had to be clamped.
uint64_t interleave(const std::vector<ExrChannel>& channels, int begin, int end, std::vector<std::byte>& out) {
  std::atomic<uint64_t> clamped{0};
  size_t stride = 0;
  for (const ExrChannel& c : channels) stride += bytesOf(c);
  const size_t rowBytes = stride * static_cast<size_t>(channels[0].plane->width);
  parallelRows(end - begin, [&](int row) {
    uint64_t clampedInRow = 0;
    std::byte* to = out.data() + static_cast<size_t>(row) * rowBytes;
    for (const ExrChannel& c : channels) {
      clampedInRow += interleaveRow(c, begin + row, stride, to);
      to += bytesOf(c);
    }
    clamped += clampedInRow;
  });
  return clamped;
}

}  // namespace

WriteReport writeExr(const std::string& path, const Estimates& estimates, const Rgb<float>& headline,
                     const Plane<float>* alpha, const ExrOptions& options) {
  BRAID_ASSERT(!headline.empty());
  const std::vector<ExrChannel> channels = namedPlanes(estimates, headline, alpha, options);
  const OIIO::ImageSpec spec = makeSpec(estimates, channels);

  OutputFile file(path, ".exr");
  WriteReport report;
  {
    const auto out = OIIO::ImageOutput::create("exr");
    if (!out) file.fail(OIIO::geterror());
    if (!out->set_ioproxy(&file)) file.fail("this OpenImageIO cannot write EXR through a stream");
    if (!out->open(file.temporaryPath(), spec)) file.fail(out->geterror());
    const int rowsAtOnce = std::min(spec.height, exrRowsPerWrite());
    std::vector<std::byte> rows(static_cast<size_t>(rowsAtOnce) * spec.scanline_bytes(true));
    for (int y = 0; y < spec.height; y += rowsAtOnce) {
      const int end = std::min(spec.height, y + rowsAtOnce);
      report.clampedToHalf += interleave(channels, y, end, rows);
      if (!out->write_scanlines(spec.y + y, spec.y + end, 0, OIIO::TypeDesc::UNKNOWN, rows.data()))
        file.fail(out->geterror());
    }
    if (!out->close()) file.fail(out->geterror());
  }
  file.finish();
  return report;
}

}  // namespace braid
