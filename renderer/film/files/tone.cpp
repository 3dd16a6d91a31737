// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/tone.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/core/image_values.h"

namespace braid {

namespace {

constexpr float kMiddleGrey = 0.18f;
// Where PBR Neutral begins to compress: nine tenths of an image stay below.
constexpr float kUncompressed = 0.8f;
// Stops; of what is all alike, a backdrop, none is dark.
constexpr double kLeastRange = 3;
// Beyond this all curves are flat, and their squares could overflow.
constexpr float kLargest = 1e6f;

// Khronos, "PBR Neutral Tone Mapper Specification" (2024): F90, Ks and Kd are its constants.
Vec3 neutral(const Vec3& colour) {
  constexpr float kF90 = 0.04f, kStart = 0.8f - kF90, kDesaturation = 0.15f;
  const float least = std::min({colour.x, colour.y, colour.z});
  const float offset = least <= 2 * kF90 ? least - least * least / (4 * kF90) : kF90;
  const Vec3 c = colour - offset;
  const float peak = maxComponent(c);
  if (peak <= kStart) return c;
  const float newPeak = 1 - (1 - kStart) * (1 - kStart) / (peak + 1 - 2 * kStart);
  const float kept = 1 / (kDesaturation * (peak - newPeak) + 1);
  return c * (newPeak / peak * kept) + Vec3(newPeak * (1 - kept));
}

// The sigmoid of AgX: through (10/16.5, 0.5) with slope 2, to 0 at 0 and to 1 at 1; powers 3 below and 3.25 above. `a`
// follows from these.
float agxContrast(float x) {
  constexpr float kPivot = 10 / 16.5f;
  const float d = x - kPivot;
  const float a = d < 0 ? 59.507875f : 69.86278913545539f, power = d < 0 ? 3.0f : 3.25f;
  return 0.5f + 2 * d * std::pow(1 + a * std::pow(std::abs(d), power), -1 / power);
}

// Sobotka, "AgX Base" for sRGB displays: primaries drawn in, log2 of 16.5 stops, contrast. The result is encoded.
Vec3 agx(const Vec3& c) {
  constexpr float kLeastLog = -12.47393f, kMostLog = 4.026069f;
  const Vec3 inset(0.842479062253094f * c.x + 0.0784335999999992f * c.y + 0.0792237451477643f * c.z,
                   0.0423282422610123f * c.x + 0.878468636469772f * c.y + 0.0791661274605434f * c.z,
                   0.0423756549057051f * c.x + 0.0784336f * c.y + 0.879142973793104f * c.z);
  Vec3 out;
  for (int i = 0; i < 3; ++i) {
    const float x = (std::log2(std::max(inset[i], 1e-10f)) - kLeastLog) / (kMostLog - kLeastLog);
    out[i] = agxContrast(std::clamp(x, 0.0f, 1.0f));
  }
  return out;
}

// Hill's fit of the reference rendering transform and the output transform for sRGB; the matrices go to its space and
// back.
Vec3 aces(const Vec3& c) {
  const Vec3 v(0.59719f * c.x + 0.35458f * c.y + 0.04823f * c.z, 0.07600f * c.x + 0.90834f * c.y + 0.01566f * c.z,
               0.02840f * c.x + 0.13383f * c.y + 0.83777f * c.z);
  const Vec3 f = (v * (v + 0.0245786f) - 0.000090537f) / (v * (0.983729f * v + 0.4329510f) + 0.238081f);
  return {1.60475f * f.x - 0.53108f * f.y - 0.07367f * f.z, -0.10208f * f.x + 1.10813f * f.y - 0.00605f * f.z,
          -0.00327f * f.x - 0.07276f * f.y + 1.07602f * f.z};
}

Vec3 encode(const Vec3& linear) {
  Vec3 out;
  for (int i = 0; i < 3; ++i) out[i] = encodeSrgb(std::clamp(linear[i], 0.0f, 1.0f));
  return out;
}

// Counts of log2 luminances: whole numbers, so that the order of pixels does not matter.
class Luminances {
 public:
  void add(const Vec3& c) {
    const float luminance = 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
    if (!(luminance > 0) || !std::isfinite(luminance)) return;
    const float bin = (std::log2(luminance) - kLeast) * kBinsPerStop;
    ++counts_[static_cast<size_t>(std::clamp(bin, 0.0f, static_cast<float>(kBins - 1)))];
    ++total_;
  }
  bool empty() const { return total_ == 0; }
  // The log2 luminance below which so great a part lies.
  float quantile(double part) const { return logOf(binOf(part)); }
  // The mean log2 luminance between two quantiles.
  double mean(double low, double high) const {
    const size_t first = binOf(low), last = binOf(high);
    double sum = 0, count = 0;
    for (size_t i = first; i <= last; ++i) {
      sum += static_cast<double>(counts_[i]) * static_cast<double>(logOf(i));
      count += static_cast<double>(counts_[i]);
    }
    return sum / count;
  }

 private:
  static constexpr float kLeast = -128, kBinsPerStop = 16;
  static constexpr size_t kBins = 256 * 16;

  static float logOf(size_t bin) { return kLeast + (static_cast<float>(bin) + 0.5f) / kBinsPerStop; }
  size_t binOf(double part) const {
    const auto wanted = static_cast<uint64_t>(part * static_cast<double>(total_ - 1));
    uint64_t below = 0;
    for (size_t i = 0; i < kBins; ++i)
      if ((below += counts_[i]) > wanted) return i;
    return kBins - 1;
  }

  std::array<uint64_t, kBins> counts_{};
  uint64_t total_ = 0;
};

}  // namespace

const char* nameOf(ToneCurve curve) {
  switch (curve) {
    case ToneCurve::Neutral:
      return "neutral";
    case ToneCurve::Agx:
      return "agx";
    case ToneCurve::Aces:
      return "aces";
    case ToneCurve::None:
      break;
  }
  return "none";
}

Vec3 toDisplay(ToneCurve curve, const Vec3& linear) {
  Vec3 c;
  // max before min: NaN becomes black.
  for (int i = 0; i < 3; ++i) c[i] = std::min(std::max(0.0f, linear[i]), kLargest);
  switch (curve) {
    case ToneCurve::Neutral:
      return encode(neutral(c));
    case ToneCurve::Agx:
      return agx(c);
    case ToneCurve::Aces:
      return encode(aces(c));
    case ToneCurve::None:
      break;
  }
  return encode(c);
}

float autoExposure(const Rgb<float>& image, const Plane<float>* alpha) {
  // A million pixels say enough of any image.
  const size_t step = image.size() / (size_t(1) << 20) + 1;
  Luminances luminances;
  for (size_t i = 0; i < image.size(); i += step) {
    const float a = alpha ? (*alpha)[i] : 1.0f;
    if (a >= 0.5f) luminances.add(image.pixel(i) / a);
  }
  if (luminances.empty()) return 0;
  const double mean = luminances.mean(0.05, 0.95);
  // Reinhard (2003), "Parameter estimation for photographic tone reproduction", without its darker half: 0.18 · 4^f.
  const auto high = static_cast<double>(luminances.quantile(0.95));
  const double low = std::min(static_cast<double>(luminances.quantile(0.05)), high - kLeastRange);
  const double highKey = std::clamp((2 * mean - low - high) / (high - low), 0.0, 1.0);
  const double key = std::log2(static_cast<double>(kMiddleGrey)) + 2 * highKey;
  const double brightest =
      std::log2(static_cast<double>(kUncompressed)) - static_cast<double>(luminances.quantile(0.9));
  const double stops = std::min(key - mean, brightest);
  return static_cast<float>(std::round(100 * stops) / 100);
}

Tone toneFor(const ToneChoice& choice, const Rgb<float>& image, const Plane<float>* alpha) {
  return {choice.curve, choice.exposure ? static_cast<float>(*choice.exposure) : autoExposure(image, alpha)};
}

}  // namespace braid
