// SPDX-License-Identifier: Apache-2.0
#include "tools/preview/preview_feed.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "tools/preview/half_size.h"

namespace braid {

namespace {

uint64_t samplesOf(const Estimates& e) { return e.estimates.front().passes; }

}  // namespace

PreviewFeed::PreviewFeed(CombineChoice combine, const Session& session, int threads, Show show, Warn warn)
    : choice_(std::move(combine)),
      combines_(!choice_.methods.empty()),
      session_(session),
      show_(std::move(show)),
      warn_(std::move(warn)) {
  helpers_ = std::max(1, (threads > 0 ? threads : machineThreads()) / 4);
}

PreviewFeed::~PreviewFeed() {
  cancel_ = true;
  noisyJob_.wait();
  combineJob_.wait();
}

void PreviewFeed::collect(BackgroundJob& job) {
  std::exception_ptr failure;
  if (!job.collect(failure) || !failure) return;
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& e) {
    if (told_.insert(e.what()).second) warn_(e.what());
  }
}

void PreviewFeed::round(const Progress& p) {
  collect(noisyJob_);
  collect(combineJob_);
  if (p.seconds < nextNoisy_ || !noisyJob_.idle()) return;
  const Stopwatch clock;
  const Snapshot snapshot = session_.snapshot();
  nextNoisy_ = p.seconds + std::max(kInterval, clock.seconds() / kHeldUpShare);
  showNoisy(snapshot, p.seconds);
  // A picture of one sample is there to be replaced: the next one does not wait for its share.
  const double pause = combineSamples_ > 1 ? combineTook_ / kCombiningShare : 0;
  if (combines_ && samplesOf(*snapshot) > combineSamples_ && combineJob_.idle() &&
      (combineBegan_ < 0 || p.seconds >= combineBegan_ + pause))
    combine(snapshot, p.seconds);
}

void PreviewFeed::showNoisy(const Snapshot& snapshot, double seconds) {
  noisyJob_.start([this, snapshot, seconds] {
    showImages(*snapshot, {}, {}, [&](const ImageViews& v) { show_(samplesOf(*snapshot), seconds, v); });
  });
}

void PreviewFeed::combine(const Snapshot& snapshot, double seconds) {
  const bool quick = combineBegan_ < 0 && snapshot->width * snapshot->height > kQuickPixels;
  combineBegan_ = seconds;
  combineSamples_ = samplesOf(*snapshot);
  combineJob_.start([this, snapshot, seconds, quick] {
    if (quick) showQuick(snapshot, seconds);
    const Stopwatch clock;
    const PipelineResult result = runCombining(*snapshot, choice_, choice_.options(&cancel_), helpers_);
    combineTook_ = clock.seconds();
    if (cancel_) return;
    showImages(*snapshot, result, choice_.methods, [&](ImageViews v) {
      // By now there are newer noisy ones.
      v.noisy = nullptr;
      v.noisyError = nullptr;
      show_(samplesOf(*snapshot), seconds, v);
    });
  });
}

void PreviewFeed::showQuick(const Snapshot& snapshot, double seconds) {
  // Whoever waits for a first picture waits for no pass.
  const PipelineResult result = runCombining(halfSize(*snapshot), choice_, choice_.options(&cancel_), 2 * helpers_);
  const PipelineOutput* out = result.find(choice_.methods.back());
  if (cancel_ || !out || !out->ran()) return;
  const Rgb<float> image = doubleSize(out->result.image.mean, snapshot->width, snapshot->height);
  ImageViews views;
  views.combined = &image;
  show_(samplesOf(*snapshot), seconds, views);
}

}  // namespace braid
