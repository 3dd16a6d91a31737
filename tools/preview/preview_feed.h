// SPDX-License-Identifier: Apache-2.0
// Takes images out of a running render for people who watch it: the noisy one a few times a second, and the combined
// one as often as a thread beside the rendering can make it. The pass loop is held up only while the estimates are
// copied, which takes at most a tenth of its time.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "renderer/session/session.h"
#include "tools/publish/image_output.h"
#include "tools/publish/publisher.h"

namespace braid {

class PreviewFeed {
 public:
  static constexpr double kInterval = 0.25;       // least seconds between noisy images
  static constexpr double kHeldUpShare = 0.1;     // of the time, for copying estimates
  static constexpr double kCombiningShare = 0.5;  // of the time, for the thread that combines
  // The first combined image of more pixels is made at half the width and height before.
  static constexpr int kQuickPixels = 1 << 18;

  // Receives images from threads of the feed, with the samples a pixel that they are made from and the seconds of the
  // render by then.
  using Show = std::function<void(uint64_t spp, double seconds, const ImageViews& views)>;
  // One line for each cause of a failure.
  using Warn = std::function<void(const std::string& text)>;

  // `threads` of the render, 0: all that the process may use.
  PreviewFeed(CombineChoice combine, const Session& session, int threads, Show show, Warn warn);
  // A combiner at work is cancelled.
  ~PreviewFeed();

  // After each round, from the session's callback.
  void round(const Progress& progress);

 private:
  using Snapshot = std::shared_ptr<const Estimates>;
  void showNoisy(const Snapshot& snapshot, double seconds);
  void combine(const Snapshot& snapshot, double seconds);
  void showQuick(const Snapshot& snapshot, double seconds);
  void collect(BackgroundJob& job);

  const CombineChoice choice_;
  const bool combines_;
  const Session& session_;
  const Show show_;
  const Warn warn_;
  int helpers_ = 1;  // threads that combine
  double nextNoisy_ = 0;
  std::atomic<double> combineTook_{0};  // seconds, the latest one
  uint64_t combineSamples_ = 0;         // of the image that was combined last
  double combineBegan_ = -1;
  std::atomic<bool> cancel_{false};
  std::set<std::string> told_;
  BackgroundJob noisyJob_, combineJob_;
};

}  // namespace braid
