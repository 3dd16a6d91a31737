// SPDX-License-Identifier: Apache-2.0
#include "tools/publisher.h"

#include <malloc.h>

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/state_file.h"
#include "tools/header.h"

namespace braid {

namespace {

// What images are expected to cost before there was one, in seconds of one core a pixel: writing all layers or few, and
// "auto" on top of it.
constexpr double kWritingAll = 1.6e-6, kWritingFew = 2e-7, kCombining = 3e-6;

int threadsOf(const PublishOptions& options) { return options.threads > 0 ? options.threads : machineThreads(); }

PublicationSchedule::Costs expectedCosts(const Session& session, const PublishOptions& options) {
  const Rgb<double>& pixels = session.state().estimates.front().sums.sums().front();
  const double share = static_cast<double>(pixels.size()) / threadsOf(options);
  const double writing = !options.image.exr.empty() && options.image.aovs == "all" ? kWritingAll : kWritingFew;
  return {share * writing, share * (writing + kCombining)};
}

ImageOutput withoutCombining(ImageOutput output) {
  output.combine.combine = "none";
  output.combine.denoisers.clear();
  return output;
}

// What compressing rows took stays with the allocator otherwise, beside what combining the next image takes.
void giveBackFreedMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

uint64_t samplesOf(const FilmState& state) { return state.estimates.front().sums.passes(); }

}  // namespace

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

bool BackgroundJob::collect(std::exception_ptr& failure) {
  if (!thread_.joinable() || !done_.load()) return false;
  thread_.join();
  failure = failure_;
  return true;
}

Publisher::Publisher(PublishOptions options, Session& session)
    : options_(std::move(options)),
      combines_(!options_.image.combine.wanted().empty() || !options_.image.combine.denoisers.empty()),
      session_(session),
      schedule_(options_.saveEvery, options_.targetError, combines_, expectedCosts(session, options_)) {
  const int threads = threadsOf(options_);
  helpers_ = std::max(1, threads / 4);
  machineShare_ = static_cast<double>(helpers_) / threads;
}

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

void Publisher::collect(std::vector<Publication>& news) {
  std::exception_ptr failure;
  if (imageJob_.collect(failure)) {
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
    reached_ = schedule_.reached();
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

void Publisher::publishImage(const Progress& p, bool combined) {
  const Stopwatch clock;
  cancel_ = false;
  pending_ = {samplesOf(session_.state()), p.seconds, combined, {}, {}};
  const auto output = std::make_shared<ImageOutput>(combined ? options_.image : withoutCombining(options_.image));
  auto shown = std::make_shared<Estimates>(describedEstimates(session_, !options_.image.noTiming));
  const auto alpha = std::make_shared<std::optional<Plane<float>>>(session_.alpha());
  heldUp_ = clock.seconds();
  jobClock_.restart();
  imageJob_.start([this, output, shown, alpha] {
    const Stopwatch job;
    try {
      pending_.image = writeImage(*output, *shown, *alpha ? &**alpha : nullptr, helpers_, &cancel_);
    } catch (...) {
      took_ = job.seconds();
      throw;
    }
    giveBackFreedMemory();
    took_ = job.seconds();
  });
}

void Publisher::giveUpIfTooLong(const Progress& p) {
  if (!imageJob_.running() || !pending_.combined) return;
  if (schedule_.tooLong(p, heldUp_ + jobClock_.seconds() * machineShare_)) cancel_ = true;
}

std::vector<Publication> Publisher::round(const Progress& p) {
  std::vector<Publication> news;
  collect(news);
  giveUpIfTooLong(p);
  PublicationSchedule::Due due = schedule_.due(p);
  due.image = due.image && hasImage() && imageJob_.idle();
  due.state = due.state && !options_.checkpoint.empty() && stateJob_.idle();
  if (due.state) saveState(p, news);
  if (due.image) publishImage(p, due.combined);
  schedule_.begun(due, p);
  return news;
}

WrittenImage Publisher::writeLast(Estimates estimates, const std::optional<Plane<float>>& alpha) {
  const Plane<float>* coverage = alpha ? &*alpha : nullptr;
  const std::vector<Attribute> attributes = estimates.attributes;
  const size_t count = estimates.estimates.size();
  try {
    return writeImage(options_.image, estimates, coverage, options_.threads);
  } catch (const std::bad_alloc&) {
    if (!combines_) throw;
  }
  // Without what may have been added for the combined file.
  estimates.attributes = attributes;
  estimates.estimates.resize(std::min(count, estimates.estimates.size()));
  writeImage(withoutCombining(options_.image), estimates, coverage, options_.threads);
  throw Error(ExitCode::OutOfMemory,
              "out of memory while combining; the image was saved without it: combine its file elsewhere (braid "
              "combine), or lower --size");
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
      writeStateFile(options_.checkpoint, film);
    } catch (const Error&) {
      failure = std::current_exception();
    }
  }
  WrittenImage written;
  if (hasImage()) {
    Estimates estimates = describedEstimates(film, session_.plan().settings.quarters, !options_.image.noTiming);
    const std::optional<Plane<float>> alpha =
        film.coverage ? std::optional(film.coverage->mean()) : std::optional<Plane<float>>();
    film = {};  // what it held is what combiners take
    written = writeLast(std::move(estimates), alpha);
  }
  if (failure) std::rethrow_exception(failure);
  return written;
}

}  // namespace braid
