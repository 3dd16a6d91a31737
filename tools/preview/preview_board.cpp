// SPDX-License-Identifier: Apache-2.0
#include "tools/preview/preview_board.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <half.h>
#include <unistd.h>

#include "tools/publish/estimated_error.h"

namespace braid {

namespace {

// A series stays short however long the render is: neighbours differ by at least so much in time.
constexpr double kPointSpacing = 1.02;
constexpr double kRateWindow = 5;  // seconds
constexpr size_t kMostWarnings = 20;
constexpr float kLargestHalf = 65504;
constexpr int kViewExponent = 6;  // radiances this many stops around 1 need no scaling

const char* toString(PreviewPhase phase) {
  switch (phase) {
    case PreviewPhase::Loading:
      return "loading";
    case PreviewPhase::Rendering:
      return "rendering";
    case PreviewPhase::Saving:
      return "saving";
    case PreviewPhase::Ended:
      break;
  }
  return "ended";
}

// Values that are no numbers stay so: a page shows where they are.
uint16_t halfBits(float value) { return half(std::clamp(value, -kLargestHalf, kLargestHalf)).bits(); }

uint16_t halfBitsOrNan(float value) { return std::isnan(value) ? uint16_t(0x7e00) : halfBits(value); }

// The exponent that brings the geometric mean of the image near 1.
int exponentFor(const Rgb<float>& image) {
  double sum = 0;
  uint64_t count = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    const float value = (image[0][i] + image[1][i] + image[2][i]) / 3;
    if (!(value > 0) || !std::isfinite(value)) continue;
    sum += std::log2(value);
    ++count;
  }
  const double mean = count > 0 ? sum / static_cast<double>(count) : 0;
  return std::abs(mean) <= kViewExponent ? 0 : -static_cast<int>(std::lround(mean));
}

std::shared_ptr<PreviewImage> emptyImage(int width, int height, int channels) {
  auto p = std::make_shared<PreviewImage>();
  p->width = width;
  p->height = height;
  p->channels = channels;
  p->pixels.reserve(static_cast<size_t>(width) * static_cast<size_t>(height) * static_cast<size_t>(channels) * 2);
  return p;
}

void append(std::string& pixels, uint16_t bits) {
  pixels += static_cast<char>(bits & 0xff);
  pixels += static_cast<char>(bits >> 8);
}

std::shared_ptr<PreviewImage> encode(const Rgb<float>& image) {
  auto p = emptyImage(image.width(), image.height(), 3);
  p->exponent = exponentFor(image);
  p->autoExposure = autoExposure(image);
  const float scale = std::ldexp(1.0f, p->exponent);
  for (size_t i = 0; i < image.size(); ++i)
    for (size_t c = 0; c < 3; ++c) append(p->pixels, halfBitsOrNan(scale * image[c][i]));
  return p;
}

// sqrt(error / (level² + 0.01)): what relativeError() averages the square of.
std::shared_ptr<PreviewImage> encodeError(const Plane<float>& error, const Plane<float>& squaredLevels) {
  auto p = emptyImage(error.width, error.height, 1);
  for (size_t i = 0; i < error.size(); ++i)
    append(p->pixels, halfBitsOrNan(std::sqrt(std::max(0.0f, error[i]) / squaredLevels[i])));
  return p;
}

uint64_t newRun() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  // Numbers of this size survive JavaScript.
  return static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(now).count()) * 100 +
         static_cast<uint64_t>(getpid() % 100);
}

}  // namespace

PreviewBoard::PreviewBoard(std::string scene, std::vector<std::string> files, const ToneChoice& tone)
    : run_(newRun()), scene_(std::move(scene)), files_(std::move(files)), tone_(tone) {}

void PreviewBoard::changed() {
  ++version_;
  condition_.notify_all();
}

void PreviewBoard::setPhase(PreviewPhase phase) {
  const std::lock_guard lock(mutex_);
  phase_ = phase;
  changed();
}

void PreviewBoard::setPlan(std::string plan, std::string combiner, int integrators) {
  const std::lock_guard lock(mutex_);
  plan_ = std::move(plan);
  combiner_ = std::move(combiner);
  integrators_ = integrators;
  changed();
}

void PreviewBoard::progress(const Progress& p) {
  const std::lock_guard lock(mutex_);
  progress_ = p;
  if (lastChange_ >= 0 && p.seconds - lastChange_ < kProgressInterval) return;
  lastChange_ = p.seconds;
  recent_.emplace_back(p.seconds, p.round);
  while (recent_.size() > 2 && p.seconds - recent_.front().first > kRateWindow) recent_.pop_front();
  changed();
}

double PreviewBoard::samplesPerSecond() const {
  if (recent_.empty()) return 0;
  // Before there are two times, the render's beginning is the other one.
  const auto [begin, first] = recent_.size() > 1 ? recent_.front() : std::pair<double, uint64_t>(0, 0);
  const auto [end, last] = recent_.back();
  return end > begin ? static_cast<double>(last - first) / (end - begin) : 0;
}

std::shared_ptr<const PreviewImage> PreviewBoard::find(const std::string& view) const {
  const auto found = images_.find(view);
  return found == images_.end() ? nullptr : found->second;
}

void PreviewBoard::put(const std::string& view, std::shared_ptr<PreviewImage> image) {
  image->version = version_;
  images_[view] = std::move(image);
}

void PreviewBoard::addPoint(const std::string& view, const ErrorPoint& point) {
  if (!std::isfinite(point.error)) return;
  std::vector<ErrorPoint>& series = history_[view];
  // The newest point moves on until it is far enough from the one before.
  if (series.size() >= 2 && series.back().seconds < kPointSpacing * series[series.size() - 2].seconds)
    series.back() = point;
  else
    series.push_back(point);
}

void PreviewBoard::show(uint64_t spp, double seconds, const ImageViews& views) {
  const auto showOne = [&](const std::string& view, const Rgb<float>* image, const Plane<float>* error,
                           const Plane<float>* known) {
    if (!image) return;
    const Plane<float> own = error && !known ? squaredLevels(*image) : Plane<float>();
    const Plane<float>* levels = known ? known : &own;
    std::shared_ptr<PreviewImage> pixels = encode(*image);
    std::shared_ptr<PreviewImage> errorPixels = error ? encodeError(*error, *levels) : nullptr;
    for (PreviewImage* p : {pixels.get(), errorPixels.get()})
      if (p) {
        p->spp = spp;
        p->seconds = seconds;
      }
    const double estimated = error ? relativeError(*error, *levels) : 0;
    const std::lock_guard lock(mutex_);
    if (const auto old = find(view); old && old->spp > spp) return;
    changed();
    put(view, std::move(pixels));
    if (!errorPixels) return;
    put(view + "-error", std::move(errorPixels));
    addPoint(view, {seconds, spp, estimated});
  };
  showOne("noisy", views.noisy, views.noisyError, views.noisyLevels);
  showOne("combined", views.combined, views.combinedError, views.combinedLevels);
}

void PreviewBoard::warn(const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (warnings_.size() < kMostWarnings) warnings_.push_back(text);
  changed();
}

void PreviewBoard::end(const std::string& reason, const std::vector<std::string>& saved) {
  const std::lock_guard lock(mutex_);
  phase_ = PreviewPhase::Ended;
  reason_ = reason;
  saved_ = saved;
  changed();
}

void PreviewBoard::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  condition_.notify_all();
}

void PreviewBoard::waitForChange(uint64_t version, double seconds) const {
  std::unique_lock lock(mutex_);
  condition_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return closed_ || version_ != version; });
}

bool PreviewBoard::isView(const std::string& view) {
  static const std::vector<std::string> known{"noisy", "combined", "error", "noisy-error", "combined-error"};
  return std::find(known.begin(), known.end(), view) != known.end();
}

std::shared_ptr<const PreviewImage> PreviewBoard::image(const std::string& view) const {
  const std::lock_guard lock(mutex_);
  if (view != "error") return find(view);
  const std::shared_ptr<const PreviewImage> combined = find("combined-error");
  return combined ? combined : find("noisy-error");
}

nlohmann::json PreviewBoard::state() const {
  using nlohmann::json;
  const std::lock_guard lock(mutex_);
  const auto textOrNull = [](const std::string& text) { return text.empty() ? json(nullptr) : json(text); };
  json images = json::object(), history = {{"noisy", json::array()}, {"combined", json::array()}};
  json error = {{"noisy", nullptr}, {"combined", nullptr}};
  int width = 0, height = 0;
  for (const auto& [view, image] : images_) {
    images[view] = {{"version", image->version}, {"spp", image->spp}, {"seconds", image->seconds}};
    width = image->width;
    height = image->height;
  }
  for (const auto& [view, points] : history_) {
    for (const ErrorPoint& p : points) history[view].push_back({p.seconds, p.spp, p.error});
    if (!points.empty()) error[view] = points.back().error;
  }
  const double spp = samplesPerSecond();
  return {{"schema", 1},
          {"run", run_},
          {"version", version_},
          {"scene", scene_},
          {"phase", toString(phase_)},
          {"stopped", phase_ == PreviewPhase::Saving || phase_ == PreviewPhase::Ended},
          {"reason", textOrNull(reason_)},
          {"width", width},
          {"height", height},
          {"spp", progress_.round},
          {"sppPlanned", progress_.rounds},
          {"seconds", progress_.seconds},
          {"secondsLeft", progress_.secondsLeft >= 0 ? json(progress_.secondsLeft) : json(nullptr)},
          {"rate", {{"spp", spp}, {"paths", spp * integrators_ * width * height}}},
          {"rejectedSamples", progress_.rejected},
          {"exposure", tone_.exposure ? json(*tone_.exposure) : json("auto")},
          {"tone", nameOf(tone_.curve)},
          {"combiner", combiner_},
          {"plan", plan_},
          {"estimatedError", error},
          {"history", history},
          {"images", images},
          {"outputs", files_},
          {"saved", saved_},
          {"warnings", warnings_}};
}

}  // namespace braid
