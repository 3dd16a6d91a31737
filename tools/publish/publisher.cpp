// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/publisher.h"

#include <malloc.h>

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/state_file.h"
#include "tools/run/alarm.h"
#include "tools/images/exr_metadata.h"
#include "tools/run/progress_line.h"

namespace braid {

namespace {

// What images are expected to cost before there was one, in seconds of one core a pixel: writing all layers or few, and
// "auto" on top of it.
constexpr double kWritingAll = 1.6e-6, kWritingFew = 4e-7, kCombining = 3e-6;

int threadsOf(int threads) { return threads > 0 ? threads : machineThreads(); }
int threadsOf(const PublishOptions& options) { return threadsOf(options.threads); }

// What compressing rows took stays with the allocator otherwise, beside what combining the next image takes.
void giveBackFreedMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

uint64_t samplesOf(const FilmState& state) { return state.estimates.front().sums.passes(); }

}  // namespace

PublicationSchedule::Costs expectedCosts(const PixelWindow& window, const ImageOutput& image, int threads) {
  const double share = static_cast<double>(window.width()) * window.height() / threadsOf(threads);
  const double writing = image.aovSet() == AovSet::All ? kWritingAll : kWritingFew;
  return {share * writing, share * (writing + kCombining)};
}

void BackgroundJob::start(std::function<void()> task) {
  BRAID_ASSERT(idle());
  done_ = false;
  failure_ = nullptr;
  thread_ = std::thread([this, task = std::move(task)] {
    try {
      task();
    } catch (...) {
      failure_ = std::current_exception();
    }
    done_ = true;
  });
}

void BackgroundJob::wait() {
  if (thread_.joinable()) thread_.join();
}

bool BackgroundJob::collect(std::exception_ptr& failure) { return done_.load() && collectLast(failure); }

bool BackgroundJob::collectLast(std::exception_ptr& failure) {
  if (!thread_.joinable()) return false;
  thread_.join();
  failure = failure_;
  return true;
}

Publisher::Publisher(PublishOptions options, Session& session)
    : options_(std::move(options)),
      combines_(!options_.image.combine.methods.empty() || !options_.image.combine.denoisers.empty()),
      session_(session),
      schedule_(options_.saveEvery, options_.targetError, combines_,
                expectedCosts(session.plan().window, options_.image, options_.threads)),
      helpers_(std::max(1, threadsOf(options_) / 4)),
      combinesLast_(combines_) {}

Publisher::~Publisher() {
  cancel_ = true;
  imageJob_.wait();
  stateJob_.wait();
}

void Publisher::fail(std::vector<Publication>& news, const std::exception_ptr& failure, const Publication& of) {
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& e) {
    if (!told_.insert(e.what()).second) return;
    news.push_back(of);
    news.back().failure = e.what();
  }
}

void Publisher::collect(std::vector<Publication>& news, bool wait) {
  std::exception_ptr failure;
  if (wait ? imageJob_.collectLast(failure) : imageJob_.collect(failure)) {
    const double cost = heldUp_ + took_ * machineShare_;
    // What a cancelled method throws is no news.
    if (failure && cancel_) pending_.image.cancelled = true;
    // The error of the plain image is not that of the combined one.
    if (combines_ && !pending_.combined) pending_.image.error.reset();
    if (pending_.image.cancelled)
      schedule_.givenUp(cost);
    else
      schedule_.published(pending_.spp, pending_.combined, cost, failure ? std::nullopt : pending_.image.error);
    if (failure && !pending_.image.cancelled)
      fail(news, failure, pending_);
    else if (!pending_.image.cancelled)
      news.push_back(pending_);
  }
  if (stateJob_.collect(failure) && failure) fail(news, failure, saving_);
}

void Publisher::saveState(const Progress& p, std::vector<Publication>& news) {
  const Stopwatch clock;
  saving_ = {samplesOf(session_.state()), p.seconds, false, {}, {}};
  try {
    std::shared_ptr<OutputFile> file = beginStateFile(options_.checkpoint, session_.state());
    stateJob_.start([file] { file->finish(); });
  } catch (const Error&) {
    fail(news, std::current_exception(), saving_);
  }
  schedule_.spend(clock.seconds());
}

void Publisher::publishImage(const Progress& p, bool combined, int threads) {
  const Stopwatch clock;
  cancel_ = false;
  machineShare_ = static_cast<double>(threads) / threadsOf(options_);
  pending_ = {samplesOf(session_.state()), p.seconds, combined, {}, {}};
  const auto output = std::make_shared<ImageOutput>((combined ? options_.image : options_.image.plain()).replaceable());
  auto shown = std::make_shared<Estimates>(describedEstimates(session_, !options_.image.noTiming));
  const auto alpha = std::make_shared<std::optional<Plane<float>>>(session_.alpha());
  heldUp_ = clock.seconds();
  jobClock_.restart();
  imageJob_.start([this, output, shown, alpha, threads] {
    const Stopwatch job;
    try {
      pending_.image = writeImage(*output, *shown, *alpha ? &**alpha : nullptr, threads, &cancel_);
    } catch (...) {
      took_ = job.seconds();
      throw;
    }
    giveBackFreedMemory();
    took_ = job.seconds();
  });
}

void Publisher::look(const Progress& p, std::vector<Publication>& news) {
  // Where no time is left for a look, the last image ends the run, and has its error.
  if (options_.limit.left() < lastCost(combines_)) return;
  cancel_ = true;  // what is at work makes way
  collect(news, true);
  const Stopwatch clock;
  publishImage(p, combines_, threadsOf(options_));
  schedule_.begun({.state = false, .image = true, .combined = combines_}, p);
  collect(news, true);
  const std::optional<double>& error = pending_.image.error;
  const bool written = !pending_.image.cancelled && pending_.image.writeSeconds > 0;
  // Where no error is ever estimated, nothing else would end an endless run.
  if (!written || (error ? *error > options_.targetError : !options_.endless)) return;
  reached_ = true;
  last_ = pending_.image;
  last_->secondsOfRun = clock.seconds();
}

double Publisher::timeLeft() const { return options_.limit.left() - (hasImage() ? lastCost(combinesLast_) : 0); }

// How much longer everything takes than on a machine that has nothing else to do: passes keep all threads at work.
double Publisher::slowdown() const {
  constexpr double kSoon = 0.1, kMost = 4;
  const double processor = static_cast<double>(std::clock() - processor_) / CLOCKS_PER_SEC, wall = clock_.seconds();
  if (wall < kSoon || processor <= 0) return 1;
  return std::clamp(wall * threadsOf(options_) / processor, 1.0, kMost);
}

void Publisher::giveUpIfTooLong(const Progress& p) {
  if (!imageJob_.running() || !pending_.combined) return;
  if (schedule_.tooLong(p, heldUp_ + jobClock_.seconds() * machineShare_)) cancel_ = true;
}

std::vector<Publication> Publisher::round(const Progress& p) {
  std::vector<Publication> news;
  collect(news);
  // Combining needs two samples at least: after the first round there has to be time for another.
  if (combines_ && (p.round == 1 || !combinesLast_))
    combinesLast_ =
        options_.limit.left() - p.seconds / static_cast<double>(std::max<uint64_t>(1, p.round)) >= lastCost(true);
  giveUpIfTooLong(p);
  if (hasImage() && schedule_.looksAt(p)) {
    look(p, news);
    if (reached_) return news;
  }
  PublicationSchedule::Due due = schedule_.due(p);
  due.image = due.image && hasImage() && imageJob_.idle();
  due.state = due.state && !options_.checkpoint.empty() && !isStream(options_.checkpoint) && stateJob_.idle();
  if (due.state) saveState(p, news);
  if (due.image) publishImage(p, due.combined, helpers_);
  schedule_.begun(due, p);
  return news;
}

// Nothing when the time for it is not there, or was not enough.
std::optional<WrittenImage> Publisher::writeCombined(Estimates& estimates, const Plane<float>* alpha) {
  const double mayTake = options_.limit.left() + options_.limit.grace() - lastCost(false);
  if (!combinesLast_ || mayTake < lastCost(true) - lastCost(false)) return std::nullopt;
  cancel_ = false;
  std::optional<Alarm> alarm;
  if (options_.limit.exists()) alarm.emplace(mayTake, [this] { cancel_ = true; });
  try {
    WrittenImage written = writeImage(options_.image, estimates, alpha, options_.threads, &cancel_);
    if (!written.cancelled) return written;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    if (!cancel_) throw;  // what a cancelled method throws is no news
  }
  return std::nullopt;
}

std::string Publisher::leftOut() const {
  return fmt::format(
      "--time {}: the image is not combined, for that would take longer: give more time, or combine it "
      "later (--aovs all, then braid combine)",
      formatSeconds(options_.limit.seconds()));
}

WrittenImage Publisher::writeLast(Estimates estimates, const std::optional<Plane<float>>& alpha) {
  const Plane<float>* coverage = alpha ? &*alpha : nullptr;
  const std::vector<Attribute> attributes = estimates.attributes;
  const size_t count = estimates.estimates.size();
  bool outOfMemory = false;
  try {
    if (!combines_) return writeImage(options_.image, estimates, coverage, options_.threads);
    if (const std::optional<WrittenImage> written = writeCombined(estimates, coverage)) return *written;
  } catch (const std::bad_alloc&) {
    if (!combines_) throw;
    outOfMemory = true;
  }
  // Without what may have been added for the combined file.
  estimates.attributes = attributes;
  estimates.estimates.resize(std::min(count, estimates.estimates.size()));
  WrittenImage plain = writeImage(options_.image.plain(), estimates, coverage, options_.threads);
  if (outOfMemory)
    throw Error(ExitCode::OutOfMemory,
                "out of memory while combining; the image was saved without it: combine its file elsewhere (braid "
                "combine), or lower --size");
  (options_.image.combine.asked ? plain.warnings : plain.timings).push_back(leftOut());
  return plain;
}

WrittenImage Publisher::finish() {
  cancel_ = true;
  const bool busy = !imageJob_.idle();
  imageJob_.wait();
  if (busy) schedule_.spend(heldUp_ + took_ * machineShare_);
  stateJob_.wait();
  FilmState film = session_.release();
  std::exception_ptr failure;
  if (!options_.checkpoint.empty()) {
    try {
      const std::shared_ptr<OutputFile> file = beginStateFile(options_.checkpoint, film);
      stateJob_.start([file] { file->finish(); });  // the disk works beside what follows
    } catch (const Error&) {
      failure = std::current_exception();
    }
  }
  WrittenImage written;
  // Streams have got nothing yet.
  if (last_ && options_.image.replaceable().files().size() == options_.image.files().size()) {
    written = *last_;
  } else if (hasImage()) {
    Estimates estimates = describedEstimates(film, session_.plan().settings.keep.quarters, !options_.image.noTiming);
    const std::optional<Plane<float>> alpha =
        film.coverage ? std::optional(film.coverage->mean()) : std::optional<Plane<float>>();
    film = {};  // what it held is what combiners take
    written = writeLast(std::move(estimates), alpha);
  }
  std::exception_ptr ofDisk;
  if (stateJob_.collectLast(ofDisk) && !failure) failure = ofDisk;
  if (failure) std::rethrow_exception(failure);
  return written;
}

}  // namespace braid
