// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/bench_publishing.h"

#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>

#include <fmt/format.h>

#include "integrators/registry.h"
#include "renderer/core/stopwatch.h"
#include "renderer/session/session.h"
#include "tools/options/combining.h"
#include "tools/images/exr_metadata.h"
#include "tools/publish/publisher.h"

namespace braid {

namespace {

struct Cost {
  double seconds = 0, processor = 0;
  double publishing = 0, combining = 0, writing = 0;  // seconds of the run: on the way, and at its end
};

template <class Task>
Cost costOf(const Task& task) {
  const Stopwatch clock;
  const std::clock_t begin = std::clock();
  task();
  Cost cost;
  cost.seconds = clock.seconds();
  cost.processor = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return cost;
}

Cost median(std::vector<Cost> costs) {
  const auto middle = [&](double Cost::*part) {
    std::sort(costs.begin(), costs.end(), [&](const Cost& a, const Cost& b) { return a.*part < b.*part; });
    return costs[costs.size() / 2].*part;
  };
  return {middle(&Cost::seconds), middle(&Cost::processor), middle(&Cost::publishing), middle(&Cost::combining),
          middle(&Cost::writing)};
}

class TemporaryFile {
 public:
  TemporaryFile() : path_(std::filesystem::temp_directory_path() / fmt::format("braid-bench-{}.exr", ::getpid())) {}
  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

// What became of the publications on the way of all repeats.
struct Counts {
  int published = 0, combined = 0;
};

// A render whose file is written plain, at its end.
Cost costAlone(const Scene& scene, const Plan& plan, const ImageOutput& image) {
  WrittenImage written;
  Cost cost = costOf([&] {
    Session session(scene, plan);
    session.advance();
    const std::optional<Plane<float>> alpha = session.alpha();
    Estimates estimates = describedEstimates(session, true);
    written = writeImage(image.plain(), estimates, alpha ? &*alpha : nullptr, plan.settings.threads);
  });
  cost.writing = written.writeSeconds;
  return cost;
}

// The same with publications on the way and combiners.
Cost costPublished(const Scene& scene, const Plan& plan, const PublishOptions& options, Counts& counts) {
  WrittenImage written;
  double spent = 0;
  Cost cost = costOf([&] {
    Session session(scene, plan);
    Publisher publisher(options, session);
    session.advance([&](const Progress& p) {
      for (const Publication& news : publisher.round(p)) {
        counts.published += news.image.cancelled || !news.failure.empty() ? 0 : 1;
        counts.combined += news.combined && !news.image.cancelled ? 1 : 0;
      }
      return true;
    });
    written = publisher.finish();
    spent = publisher.spent();
  });
  cost.publishing = spent;
  cost.combining = written.combineSeconds;
  cost.writing = written.writeSeconds;
  return cost;
}

}  // namespace

nlohmann::json benchPublishing(const Scene& scene, const CameraData& camera, const Settings& settings,
                               const std::vector<std::string>& methods, int repeats) {
  const auto integrators = makeIntegrators();
  Plan plan = makePlan(scene, camera, settings, pointersTo(integrators));
  const TemporaryFile file;
  PublishOptions options;
  options.image.file = file.path();
  options.image.aovs = AovSet::All;
  options.image.combine.methods = methods;
  options.threads = settings.threads;
  requireRunnable(planCombining(options.image.combine, settings.spp, plan), methods);
  std::vector<Cost> alone, published;
  Counts counts;
  for (int k = 0; k < repeats; ++k) {
    alone.push_back(costAlone(scene, plan, options.image));
    published.push_back(costPublished(scene, plan, options, counts));
  }
  const Cost a = median(alone), p = median(published);
  const double more = p.publishing + p.combining + std::max(0.0, p.writing - a.writing);
  return {{"spp", settings.spp},
          {"methods", options.image.combine.text()},
          {"seconds", a.seconds},
          {"publishedSeconds", p.seconds},
          {"overhead", p.seconds / a.seconds - 1},
          {"share", more / p.seconds},
          {"publishingSeconds", p.publishing},
          {"lastCombineSeconds", p.combining},
          {"lastWriteSeconds", p.writing},
          {"plainWriteSeconds", a.writing},
          {"processorSeconds", a.processor},
          {"publishedProcessorSeconds", p.processor},
          {"processorOverhead", p.processor / a.processor - 1},
          {"publications", static_cast<double>(counts.published) / repeats + 1},
          {"combinedPublications", static_cast<double>(counts.combined) / repeats + 1}};
}

}  // namespace braid
