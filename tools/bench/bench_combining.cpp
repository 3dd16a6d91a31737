// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/bench_combining.h"

#include <algorithm>
#include <map>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"
#include "integrators/registry.h"
#include "renderer/core/parallel.h"
#include "renderer/session/session.h"

namespace braid {

namespace {

// pt, what is named after an '@', and common random numbers where a method wants them.
std::vector<std::string> integratorsFor(const std::vector<std::string>& methods) {
  std::vector<std::string> names = {"pt"};
  const auto add = [&](const std::string& name) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  for (const std::string& method : methods) {
    for (const auto& integrator : makeIntegrators()) {
      const std::string name = integrator->name();
      const size_t at = method.find("@" + name);
      if (at != std::string::npos && (at + 1 + name.size() == method.size() || method[at + 1 + name.size()] == '@'))
        add(name);
    }
    if (findMethod(method.substr(0, method.find('@')))->needs().correlated) add("crn");
  }
  return names;
}

}  // namespace

nlohmann::json benchCombining(const Scene& scene, const CameraData& camera, Settings settings,
                              const std::vector<std::string>& methods, int repeats) {
  settings.integrators = integratorsFor(methods);
  settings.keep = KeptBuffers::everything();
  const auto integrators = makeIntegrators();
  Session session(scene, makePlan(scene, camera, settings, pointersTo(integrators)));
  const std::shared_ptr<const Estimates> estimates = session.run().estimates;
  std::map<std::string, std::vector<double>> seconds;
  PipelineResult last;
  for (int k = 0; k < repeats; ++k) {
    withThreads(settings.threads, [&] { last = runPipeline(*estimates, methods, {}); });
    for (const PipelineOutput& out : last.outputs) seconds[out.step.name].push_back(out.seconds);
  }
  const double megapixels = 1e-6 * estimates->width * estimates->height;
  nlohmann::json list = nlohmann::json::array();
  for (const PipelineOutput& out : last.outputs) {
    if (!out.ran()) {
      list.push_back({{"method", out.step.name}, {"skipReason", out.step.skipReason}});
      continue;
    }
    std::vector<double>& times = seconds[out.step.name];
    std::sort(times.begin(), times.end());
    const double median = times[times.size() / 2];
    list.push_back({{"method", out.step.name},
                    {"seconds", median},
                    {"inputSeconds", out.inputSeconds},
                    {"secondsPerMegapixel", median / megapixels}});
  }
  return list;
}

}  // namespace braid
