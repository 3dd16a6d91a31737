// SPDX-License-Identifier: Apache-2.0
// Shows and saves what a render has while it goes on. The pass loop is held up for as long as it takes to copy the
// estimates and, with a checkpoint, to hand its bytes to the system; combining, compressing and waiting for the disk
// happen beside it. Files are replaced whole, so a reader or a crash finds the last complete one.
#pragma once

#include <atomic>
#include <ctime>
#include <exception>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "renderer/session/session.h"
#include "renderer/core/stopwatch.h"
#include "tools/publish/image_output.h"
#include "tools/publish/publication_schedule.h"
#include "tools/run/run_clock.h"

namespace braid {

// One task at a time on a thread of its own.
class BackgroundJob {
 public:
  ~BackgroundJob() { wait(); }
  bool running() const { return thread_.joinable() && !done_.load(); }
  // Nothing is under way, and what was has been collected.
  bool idle() const { return !thread_.joinable(); }
  // Must be idle.
  void start(std::function<void()> task);
  void wait();
  // Once after the task has ended: true, and what it threw if anything.
  bool collect(std::exception_ptr& failure);
  // The same after waiting for the end.
  bool collectLast(std::exception_ptr& failure);

 private:
  std::thread thread_;
  std::atomic<bool> done_{false};
  std::exception_ptr failure_;
};

struct PublishOptions {
  ImageOutput image;
  std::string checkpoint;  // empty: none
  double saveEvery = 60;   // seconds
  double targetError = 0;  // 0: none
  bool endless = false;    // nothing but the target ends the run
  int threads = 0;         // of the render
  TimeLimit limit;         // of the process: the last image has to be written by then
};

// Something that was published, or was to be.
struct Publication {
  uint64_t spp = 0;
  double seconds = 0;     // of the run, when it was begun
  bool combined = false;  // not yet by the combiners that were asked for, otherwise
  WrittenImage image;
  std::string failure;  // one line, told once for each cause; the render goes on
};

// What images of these pixels are expected to cost before there was one; `threads` 0: all that the process may use.
PublicationSchedule::Costs expectedCosts(const PixelWindow& window, const ImageOutput& image, int threads);

class Publisher {
 public:
  Publisher(PublishOptions options, Session& session);
  // Waits for what is being written; a combiner at work is cancelled.
  ~Publisher();

  // After each round, from the session's callback: publishes if it is time. What has been published meanwhile, or could
  // not be, is returned.
  std::vector<Publication> round(const Progress& progress);

  // For Session::run(): the error of the image met the target.
  const std::atomic<bool>& reached() const { return reached_; }

  // For Session::setTimeLeft(): the seconds that passes may take until finish() has to begin. Where the limit does not
  // leave enough for combining the last image, that is left out rather than samples.
  double timeLeft() const;

  // What was published on the way has taken of the whole machine, in seconds: holding up the passes, and the work
  // beside them.
  double spent() const { return schedule_.spent(); }

  // After the run: saves the state and the final image, for which the film makes room. Both are tried; throws
  // Error(OutputFailed) of the first that failed.
  WrittenImage finish();

 private:
  // What is done; `wait`: what is under way, too.
  void collect(std::vector<Publication>& news, bool wait = false);
  void fail(std::vector<Publication>& news, const std::exception_ptr& failure, const Publication& of);
  void saveState(const Progress& progress, std::vector<Publication>& news);
  void publishImage(const Progress& progress, bool combined, int threads);
  // Makes the image of now, all threads at it, and sees whether it is good enough.
  void look(const Progress& progress, std::vector<Publication>& news);
  void giveUpIfTooLong(const Progress& progress);
  WrittenImage writeLast(Estimates estimates, const std::optional<Plane<float>>& alpha);
  std::optional<WrittenImage> writeCombined(Estimates& estimates, const Plane<float>* alpha);
  std::string leftOut() const;
  // An image is expected to take so many seconds now.
  double lastCost(bool combined) const { return schedule_.cost(combined, slowdown()); }
  double slowdown() const;
  bool hasImage() const { return options_.image.show || !options_.image.files().empty(); }

  const PublishOptions options_;
  const bool combines_;
  Session& session_;
  PublicationSchedule schedule_;
  int helpers_ = 1;          // threads of a publication
  double machineShare_ = 1;  // of the machine that the threads at work are
  bool combinesLast_;        // the last image, too: there is time for it
  std::atomic<bool> reached_{false}, cancel_{false};
  Publication pending_, saving_;
  std::optional<WrittenImage> last_;  // of the look that ended the run: nothing is left to do
  double heldUp_ = 0;                 // seconds for which the pending publication stopped the pass loop
  double took_ = 0;                   // seconds of the job beside it
  Stopwatch jobClock_, clock_;
  std::clock_t processor_ = std::clock();  // by then, what the process had taken of it
  std::set<std::string> told_;
  BackgroundJob imageJob_, stateJob_;
};

}  // namespace braid
