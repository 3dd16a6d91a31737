// SPDX-License-Identifier: Apache-2.0
// What a preview has to show: the newest images, how far the render is, and how its error fell. The render writes it,
// any number of readers wait for it and read it, from any thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "renderer/session/session.h"
#include "tools/publish/image_output.h"

namespace braid {

// What a preview is doing.
enum class PreviewPhase { Loading, Rendering, Saving, Ended };

// Pixels for a page: 16-bit floats, little-endian, row after row, channels interleaved.
struct PreviewImage {
  int width = 0, height = 0;
  int channels = 0;        // 3: radiance; 1: relative error
  int exponent = 0;        // values are multiplied by 2^exponent to suit the range of 16-bit floats
  uint64_t spp = 0;        // of the estimates that it was made from
  double seconds = 0;      // of the render by then
  uint64_t version = 0;    // changes with every new image
  float autoExposure = 0;  // of radiance: what brings it to middle grey, in stops
  std::string pixels;
};

class PreviewBoard {
 public:
  static constexpr double kProgressInterval = 0.25;  // seconds of the render between changes by progress alone

  // Before the render starts. `tone`: what a page begins with.
  PreviewBoard(std::string scene, std::vector<std::string> files, const ToneChoice& tone);

  void setPhase(PreviewPhase phase);
  void setPlan(std::string plan, std::string combiner, int integrators);
  void progress(const Progress& progress);
  // Images made from `spp` samples a pixel, `seconds` after the render began; ignored where newer ones are known.
  void show(uint64_t spp, double seconds, const ImageViews& views);
  void warn(const std::string& text);
  // How the render ended, and which files hold it.
  void end(const std::string& reason, const std::vector<std::string>& saved);
  // Nobody waits any more.
  void close();

  // Everything but the pixels, with "schema": 1.
  nlohmann::json state() const;
  // Returns when something has changed since state() said "version": `version`, or after so many seconds.
  void waitForChange(uint64_t version, double seconds) const;

  // "noisy", "combined", "noisy-error", "combined-error", or "error": that of the combined image, if there is one, else
  // that of the noisy one. Null: not there (yet).
  std::shared_ptr<const PreviewImage> image(const std::string& view) const;
  static bool isView(const std::string& view);

 private:
  struct ErrorPoint {
    double seconds = 0;
    uint64_t spp = 0;
    double error = 0;
  };
  std::shared_ptr<const PreviewImage> find(const std::string& view) const;
  void put(const std::string& view, std::shared_ptr<PreviewImage> image);
  void addPoint(const std::string& view, const ErrorPoint& point);
  void changed();
  double samplesPerSecond() const;

  mutable std::mutex mutex_;
  mutable std::condition_variable condition_;
  uint64_t version_ = 1;
  bool closed_ = false;
  const uint64_t run_;  // tells runs apart
  const std::string scene_;
  const std::vector<std::string> files_;
  const ToneChoice tone_;
  std::string plan_, combiner_ = "none", reason_;
  int integrators_ = 1;
  std::vector<std::string> saved_, warnings_;
  PreviewPhase phase_ = PreviewPhase::Loading;
  Progress progress_;
  double lastChange_ = -1;                          // of the progress, in seconds of the render
  std::deque<std::pair<double, uint64_t>> recent_;  // seconds and rounds, for the rate
  std::map<std::string, std::shared_ptr<const PreviewImage>> images_;
  std::map<std::string, std::vector<ErrorPoint>> history_;  // by view: noisy, combined
};

}  // namespace braid
