// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/methods/sweep_pipeline.h"

#include <algorithm>

#include <fmt/format.h>

#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"
#include "renderer/core/error.h"
#include "tools/publish/estimated_error.h"

namespace braid {

namespace {

using Integrators = std::vector<const Integrator*>;

const Integrator* findIntegrator(const Integrators& list, const std::string& name) {
  const auto found = std::find_if(list.begin(), list.end(), [&](const Integrator* i) { return i->name() == name; });
  return found == list.end() ? nullptr : *found;
}

// What a session will know of an integrator's estimate; checkpoints grow with the rounds.
AvailableEstimate availableIn(const Integrator& integrator) {
  AvailableEstimate available;
  available.name = integrator.name();
  available.unbiased = integrator.unbiased();
  available.correlation = integrator.correlation();
  available.quarters = true;
  available.checkpoints = 1 << 20;
  available.bias = integrator.estimatesBias();
  available.directIndirect = integrator.separatesDirectLight();
  return available;
}

// Runs all methods of the same inputs when the first of them is asked about a snapshot.
class SharedPipeline {
 public:
  SharedPipeline(std::vector<MethodShare> inputs, std::string unbiased, const MethodOptions& numbers)
      : inputs_(std::move(inputs)) {
    options_.roles.unbiased = std::move(unbiased);
    options_.numbers = numbers;
  }
  const std::vector<MethodShare>& inputs() const { return inputs_; }
  void want(const std::string& method) { wanted_.push_back(method); }

  MethodImage image(const std::shared_ptr<const Estimates>& estimates, const Rgb<float>& reference,
                    const std::string& method) {
    if (estimates != estimates_) run(estimates, reference);
    const PipelineOutput* output = result_.find(method);
    MethodImage made;
    if (!output || !output->ran()) {
      made.skipReason = output ? output->step.skipReason : "did not run";
      made.failed = output && output->failed;
      return made;
    }
    made.image = output->result.image.mean;
    if (!output->result.error.empty()) made.error = relativeError(output->result.error, squaredLevels(made.image));
    const bool denoiser = output->step.method->kind() == MethodKind::Denoiser;
    made.denoiseSeconds = output->inputSeconds + (denoiser ? output->seconds : 0);
    made.combineSeconds = denoiser ? 0 : output->seconds;
    return made;
  }

 private:
  // Without the estimates that other methods brought in: roles are filled from what there is.
  void run(const std::shared_ptr<const Estimates>& estimates, const Rgb<float>& reference) {
    Estimates own = *estimates;
    own.reference = reference;
    const auto foreign = [&](const Estimate& e) {
      return std::none_of(inputs_.begin(), inputs_.end(), [&](const MethodShare& i) { return i.integrator == e.name; });
    };
    own.estimates.erase(std::remove_if(own.estimates.begin(), own.estimates.end(), foreign), own.estimates.end());
    result_ = runPipeline(own, wanted_, options_);
    estimates_ = estimates;
  }

  std::vector<MethodShare> inputs_;
  PipelineOptions options_;
  std::vector<std::string> wanted_;
  std::shared_ptr<const Estimates> estimates_;
  PipelineResult result_;
};

// A name taken apart and what it needs.
struct Parsed {
  std::string method;  // in the form of combine plans
  std::vector<MethodShare> inputs;
  KeptBuffers buffers;
};

[[noreturn]] void refuseMethod(const std::string& name, const std::string& reason) {
  throw Error(ExitCode::Usage, fmt::format("--methods: {}: {}", name, reason));
}

// The integrators of "bdpt+sppm"; none if one of the names is not known.
std::vector<const Integrator*> joinedIntegrators(const std::string& text, const Integrators& integrators) {
  std::vector<const Integrator*> list;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('+', begin), text.size());
    const Integrator* i = findIntegrator(integrators, text.substr(begin, end - begin));
    if (!i) return {};
    if (std::find(list.begin(), list.end(), i) == list.end()) list.push_back(i);
    begin = end + 1;
  }
  return list;
}

// Integrators that a name speaks of: before a slash or pt, and after each '@'.
std::vector<const Integrator*> namedIntegrators(const std::string& name, std::string& method,
                                                const Integrators& integrators) {
  // A slash may also be part of a file's path: external:folder/file.exr.
  const size_t slash = name.find('/');
  std::vector<const Integrator*> list;
  if (slash != std::string::npos) list = joinedIntegrators(name.substr(0, slash), integrators);
  method = list.empty() ? name : name.substr(slash + 1);
  if (list.empty() && findIntegrator(integrators, "pt")) list = {findIntegrator(integrators, "pt")};
  if (list.empty()) refuseMethod(name, "there is no integrator pt: name one before a slash");
  for (size_t at = method.find('@'); at != std::string::npos; at = method.find('@', at + 1)) {
    const Integrator* i = findIntegrator(integrators, method.substr(at + 1, method.find('@', at + 1) - at - 1));
    if (i && std::find(list.begin(), list.end(), i) == list.end()) list.push_back(i);
  }
  return list;
}

// Throws Error(Usage) naming what there is: integrators as well as denoisers and combiners.
Needs needsOfMethod(const std::string& method, const Integrators& integrators) {
  try {
    return findMethod(method.substr(0, method.find('@')))->needs();
  } catch (const Error& e) {
    std::string known;
    for (const Integrator* i : integrators) known += fmt::format("{}{}", known.empty() ? "" : ", ", i->name());
    throw Error(e.code(), fmt::format("--methods: {}; integrators are {}", e.what(), known));
  }
}

Parsed parse(const std::string& name, const Integrators& integrators) {
  Parsed parsed;
  std::vector<const Integrator*> list = namedIntegrators(name, parsed.method, integrators);
  if (needsOfMethod(parsed.method, integrators).correlated) {
    const auto correlated = std::find_if(integrators.begin(), integrators.end(), [](const Integrator* i) {
      return i->unbiased() && i->correlation() != Correlation::Independent;
    });
    if (correlated != integrators.end() && std::find(list.begin(), list.end(), *correlated) == list.end())
      list.push_back(*correlated);
  }
  // The first one is the unbiased image, and plans name photon maps in any order.
  const auto unbiased = std::find_if(list.begin(), list.end(), [](const Integrator* i) { return i->unbiased(); });
  if (unbiased != list.end()) std::rotate(list.begin(), unbiased, unbiased + 1);
  AvailableEstimates available;
  available.features = available.reference = true;
  for (const Integrator* i : list) {
    available.estimates.push_back(availableIn(*i));
    parsed.inputs.push_back({i->name(), 1});
  }
  CombinePlanOptions roles;
  roles.unbiased = list.front()->name();
  const CombinePlan combinePlan = makeCombinePlan(available, {parsed.method}, roles);
  const Step* step = combinePlan.find(parsed.method);
  BRAID_ASSERT(step);
  if (!step->skipReason.empty()) refuseMethod(name, step->skipReason);
  parsed.buffers = buffersOf(combinePlan);
  return parsed;
}

}  // namespace

std::vector<SweepMethod> sweepMethods(const std::vector<std::string>& names, const Integrators& integrators,
                                      const MethodOptions& numbers, const std::string& planned) {
  const std::string automatic = "auto/";
  const std::vector<SweepMethod> plain = integratorMethods(integrators);
  std::vector<SweepMethod> known = plain;
  std::vector<std::shared_ptr<SharedPipeline>> pipelines;
  for (const std::string& name : names) {
    if (findIntegrator(integrators, name)) continue;
    const Parsed parsed =
        parse(name.starts_with(automatic) ? planned + name.substr(automatic.size() - 1) : name, integrators);
    auto found =
        std::find_if(pipelines.begin(), pipelines.end(), [&](const auto& p) { return p->inputs() == parsed.inputs; });
    if (found == pipelines.end())
      found = pipelines.insert(
          found, std::make_shared<SharedPipeline>(parsed.inputs, parsed.inputs.front().integrator, numbers));
    const std::shared_ptr<SharedPipeline> pipeline = *found;
    pipeline->want(parsed.method);
    SweepMethod method;
    method.name = name;
    method.inputs = parsed.inputs;
    method.buffers = parsed.buffers;
    method.finish = [pipeline, wanted = parsed.method](const std::shared_ptr<const Estimates>& estimates,
                                                       const Rgb<float>& reference) {
      return pipeline->image(estimates, reference, wanted);
    };
    known.push_back(std::move(method));
  }
  return chooseMethods(names, known);
}

}  // namespace braid
