// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/exr.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>
#include <vector>

#include <half.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/files/exr_rows.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/make_attribute.h"
#include "renderer/images/image_codecs.h"
#include "renderer/film/planes.h"

namespace braid {

namespace {

constexpr float kHalfMax = 65504;

using Names = std::array<const char*, 3>;
constexpr Names kColour = {"R", "G", "B"};

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

// `all`: with the halves and the variance of the mean.
void addFeatures(ChannelList& channels, const Features& features, bool all, bool half) {
  for (size_t f = 0; f < kFeaturePlanes.size(); ++f) {
    channels.setHalf(half && !all && !kFeaturePlanes[f].anySize);
    const std::string_view components = kFeaturePlanes[f].components;
    for (size_t part = 0; part < (all ? kFeatureParts.size() : 1); ++part)
      for (size_t c = 0; c < components.size(); ++c)
        channels.add(std::string(kFeaturePlanes[f].layer) + kFeatureParts[part] + '.' + components[c],
                     featurePlane(features, f, part, c));
  }
  channels.setHalf(false);
}

void addEstimate(ChannelList& channels, const Estimate& e, const ExrOptions& options) {
  for (const EstimatePlane& p : estimatePlanes())
    if (p.set != PlaneSet::Direct || options.directIndirect) channels.add(e.name + '.' + p.name, kColour, p.in(e));
  if (!options.quarters) return;
  for (size_t q = 0; q < e.quarter.size(); ++q) channels.add(e.name + '.' + quarterName(q), kColour, e.quarter[q]);
}

void addHistory(ChannelList& channels, const std::string& estimate, const std::vector<Checkpoint>& history) {
  for (const Checkpoint& c : history)
    for (const HistoryPlane& p : historyPlanes())
      channels.add(estimate + '.' + p.name + std::to_string(c.passes), kColour, p.in(c));
}

}  // namespace

std::vector<ExrChannel> namedPlanes(const Estimates& estimates, const Rgb<float>& headline, const Plane<float>* alpha,
                                    const ExrOptions& options) {
  ChannelList channels(headline.width(), headline.height(), options.layerPrefix);
  const bool half = !options.floatHeadline;
  for (size_t c = 0; c < 3; ++c) channels.addHeadline(kColour[c], headline[c], half);
  if (alpha) channels.addHeadline("A", *alpha, half);
  const bool all = options.aovs == AovSet::All;
  if (options.aovs != AovSet::None && estimates.features) addFeatures(channels, *estimates.features, all, half);
  if (options.aovs == AovSet::Features)
    for (const ExrLayer& layer : options.layers)
      if (layer.name == "Error" && layer.plane) channels.add(layer.name, "Y", *layer.plane);
  if (options.aovs != AovSet::None)
    for (const Estimate& e : estimates.estimates) channels.add("SampleCount", "Y", e.samples);
  if (!all) return channels.list();
  for (const Estimate& e : estimates.estimates) {
    addEstimate(channels, e, options);
    const auto history = estimates.history.find(e.name);
    if (options.history && history != estimates.history.end()) addHistory(channels, e.name, history->second);
  }
  for (const ExrLayer& layer : options.layers) {
    if (layer.planes) channels.add(layer.name, kColour, *layer.planes);
    if (layer.plane) channels.add(layer.name, "Y", *layer.plane);
  }
  return channels.list();
}

namespace {

std::vector<Attribute> attributesOf(const Estimates& estimates) {
  std::vector<Attribute> list{textAttribute("compression", "zip:1")};
  // OpenImageIO adds the date of writing when there is none; files must reproduce byte for byte, and an empty date is
  // the way to have none.
  list.push_back(textAttribute("DateTime", ""));
  // R, G, B, white D65: x, y
  const std::vector<float> rec709 = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
  list.push_back({"chromaticities", Attribute::Kind::Chromaticities, "", 0, 0, rec709});
  list.push_back(textAttribute("colorInteropID", "lin_rec709_scene"));
  list.push_back(textAttribute("braid/varianceIs", "variance of the pixel mean"));
  for (const Attribute& a : estimates.attributes) {
    BRAID_ASSERT(a.kind != Attribute::Kind::Matrix || a.values.size() == 16);
    BRAID_ASSERT(a.kind != Attribute::Kind::Chromaticities || a.values.size() == 8);
    list.push_back(a);
  }
  return list;
}

ImageHeader makeHeader(const Estimates& estimates, const std::vector<ExrChannel>& channels) {
  ImageHeader header;
  header.width = channels[0].plane->width;
  header.height = channels[0].plane->height;
  header.type = SampleType::Float;
  for (const ExrChannel& c : channels) {
    header.channels.push_back(c.name);
    header.channelTypes.push_back(c.half ? SampleType::Half : SampleType::Float);
    if (c.name == "A") header.alpha = static_cast<int>(header.channels.size()) - 1;
  }
  if (estimates.window.width() > 0) {
    BRAID_ASSERT(estimates.window.width() == header.width && estimates.window.height() == header.height);
    header.x = estimates.window.x0;
    header.y = estimates.window.y0;
  }
  header.fullWidth = estimates.fullWidth;
  header.fullHeight = estimates.fullHeight;
  header.attributes = attributesOf(estimates);
  return header;
}

size_t bytesOf(const ExrChannel& channel) { return channel.half ? sizeof(half) : sizeof(float); }

size_t pixelBytes(const std::vector<ExrChannel>& channels) {
  size_t bytes = 0;
  for (const ExrChannel& c : channels) bytes += bytesOf(c);
  return bytes;
}

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
  const size_t stride = pixelBytes(channels);
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
  const ImageHeader header = makeHeader(estimates, channels);

  const ImageCodecs& codecs = imageCodecs();
  OutputFile file(path, ".exr");
  WriteReport report;
  std::string error;
  {
    const auto out = codecs.create("exr", file.temporaryPath(), header, file, error);
    if (!out) file.fail(error);
    const int rowsAtOnce = std::min(header.height, exrRowsPerWrite());
    std::vector<std::byte> rows(static_cast<size_t>(rowsAtOnce) * static_cast<size_t>(header.width) *
                                pixelBytes(channels));
    for (int y = 0; y < header.height; y += rowsAtOnce) {
      const int end = std::min(header.height, y + rowsAtOnce);
      report.clampedToHalf += interleave(channels, y, end, rows);
      if (!out->writeRows(y, end, rows.data())) file.fail(out->takeError());
    }
    if (!out->close()) file.fail(out->takeError());
  }
  file.finish();
  return report;
}

}  // namespace braid
