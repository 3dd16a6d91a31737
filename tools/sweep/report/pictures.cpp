// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/report/pictures.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/make_attribute.h"
#include "renderer/images/image_codecs.h"
#include "tools/metrics/tonemap.h"

namespace braid {

namespace {

constexpr size_t kJpegPixels = 256 * 256;

uint8_t toByte(float v) { return static_cast<uint8_t>(std::clamp(v, 0.0f, 1.0f) * 255 + 0.5f); }

// The value that a fraction of the finite ones do not exceed; 0 when there are none.
double percentile(std::vector<double> values, double fraction) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }), values.end());
  if (values.empty()) return 0;
  const auto k = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<size_t>(k)];
}

// From dark blue through magenta and orange to pale yellow, luminance rising: order can be read without a legend.
Vec3 heat(float t) {
  static const Vec3 stops[] = {{0.00f, 0.00f, 0.02f}, {0.12f, 0.05f, 0.32f}, {0.37f, 0.07f, 0.50f},
                               {0.62f, 0.17f, 0.48f}, {0.85f, 0.31f, 0.36f}, {0.97f, 0.53f, 0.20f},
                               {0.99f, 0.78f, 0.30f}, {0.99f, 0.98f, 0.75f}};
  constexpr int kLast = static_cast<int>(std::size(stops)) - 1;
  const float x = std::clamp(t, 0.0f, 1.0f) * kLast;
  const int i = std::min(static_cast<int>(x), kLast - 1);
  return glm::mix(stops[i], stops[i + 1], x - static_cast<float>(i));
}

void set(Picture& p, size_t i, const Vec3& v) {
  for (int c = 0; c < 3; ++c) p.rgb[3 * i + static_cast<size_t>(c)] = toByte(v[c]);
}

Picture blank(int width, int height) {
  return {width, height, std::vector<uint8_t>(3 * static_cast<size_t>(width) * static_cast<size_t>(height))};
}

template <class T>
Plane<T> shrunkPlane(const Plane<T>& in, int maxWidth) {
  const int block = (in.width + maxWidth - 1) / maxWidth;
  if (block <= 1) return in;
  Plane<T> out((in.width + block - 1) / block, (in.height + block - 1) / block);
  parallelRows(out.height, [&](int y) {
    for (int x = 0; x < out.width; ++x) {
      double sum = 0, count = 0;
      for (int v = y * block; v < std::min(in.height, (y + 1) * block); ++v)
        for (int u = x * block; u < std::min(in.width, (x + 1) * block); ++u, ++count)
          sum += static_cast<double>(in.at(u, v));
      out.at(x, y) = static_cast<T>(sum / count);
    }
  });
  return out;
}

template <class T>
Plane<T> croppedPlane(const Plane<T>& in, const PixelWindow& w) {
  Plane<T> out(w.width(), w.height());
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) out.at(x, y) = in.at(w.x0 + x, w.y0 + y);
  return out;
}

// Empty: it cannot be, and `error` says why.
std::string encode(const Picture& picture, const char* format, std::string& error) {
  ImageHeader header;
  header.width = picture.width;
  header.height = picture.height;
  header.type = SampleType::Byte;
  header.channels = {"R", "G", "B"};
  header.attributes = {textAttribute("oiio:ColorSpace", "sRGB"), textAttribute("Compression", "jpeg:88")};
  MemorySink memory;
  const auto out = imageCodecs().create(format, std::string("picture.") + format, header, memory, error);
  if (out && out->writeImage(picture.rgb.data()) && out->close()) return memory.bytes();
  if (out) error = out->takeError();
  return {};
}

}  // namespace

float exposureOf(const Rgb<float>& reference) {
  std::vector<double> luminances;
  for (size_t i = 0; i < reference.size(); ++i)
    luminances.push_back(static_cast<double>(luminance(reference.pixel(i))));
  double level = percentile(luminances, 0.95);
  // A small light in the dark: by what is brightest.
  if (!(level > 0)) level = percentile(luminances, 1);
  return level > 0 ? static_cast<float>(0.8 / level) : 1.0f;
}

Picture toneMapped(const Rgb<float>& image, float exposure) {
  Picture p = blank(image.width(), image.height());
  parallelChunks(image.size(), kPixelChunk, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec3 v = exposure * image.pixel(i);
      set(p, i, isFinite(v) ? Vec3(displayValue(v.x), displayValue(v.y), displayValue(v.z)) : Vec3(1, 0, 1));
    }
  });
  return p;
}

Picture falseColour(const Plane<double>& errors, double lo, double hi) {
  Picture p = blank(errors.width, errors.height);
  const double scale = 1 / std::log(hi / lo);
  for (size_t i = 0; i < errors.size(); ++i)
    set(p, i, heat(errors[i] > lo ? static_cast<float>(std::log(std::min(errors[i], hi) / lo) * scale) : 0.0f));
  return p;
}

Picture colourBar(int width, int height) {
  Picture p = blank(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      set(p, static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x),
          heat(static_cast<float>(x) / static_cast<float>(std::max(1, width - 1))));
  return p;
}

Rgb<float> shrunk(const Rgb<float>& image, int maxWidth) {
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = shrunkPlane(image[c], maxWidth);
  return out;
}

Plane<double> shrunk(const Plane<double>& plane, int maxWidth) { return shrunkPlane(plane, maxWidth); }

Rgb<float> cropped(const Rgb<float>& image, const PixelWindow& window) {
  Rgb<float> out;
  for (size_t c = 0; c < 3; ++c) out[c] = croppedPlane(image[c], window);
  return out;
}

Plane<double> cropped(const Plane<double>& plane, const PixelWindow& window) { return croppedPlane(plane, window); }

PixelWindow worstWindow(const Plane<double>& errors, int size) {
  const int width = std::min(size, errors.width), height = std::min(size, errors.height);
  const double limit = percentile({errors.data.begin(), errors.data.end()}, 0.99);
  PixelWindow worst{0, 0, width, height};
  double largest = -1;
  const int step = std::max(1, size / 4);
  for (int y = 0; y + height <= errors.height; y += step)
    for (int x = 0; x + width <= errors.width; x += step) {
      double sum = 0;
      for (int v = y; v < y + height; ++v)
        for (int u = x; u < x + width; ++u) sum += std::min(limit, errors.at(u, v));
      if (sum > largest) {
        largest = sum;
        worst = {x, y, x + width, y + height};
      }
    }
  return worst;
}

std::string base64(const std::string& bytes) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t v = 0;
    for (size_t k = 0; k < 3; ++k) v = v << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) out += i + k <= bytes.size() ? digits[v >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::string dataUri(const Picture& picture) {
  std::string error;
  if (static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height) > kJpegPixels) {
    const std::string jpeg = encode(picture, "jpg", error);
    if (!jpeg.empty()) return "data:image/jpeg;base64," + base64(jpeg);
  }
  const std::string png = encode(picture, "png", error);
  if (png.empty()) throw Error(ExitCode::OutputFailed, "the report's pictures cannot be encoded: " + error);
  return "data:image/png;base64," + base64(png);
}

}  // namespace braid
