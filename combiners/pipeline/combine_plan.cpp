// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/combine_plan.h"

#include <algorithm>
#include <bit>
#include <set>

#include <fmt/format.h>

#include "combiners/pipeline/denoise_cutoff.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/registry.h"

namespace braid {

namespace {

// Best first: the learned one, the regressions, then the non-local filters by their error on the synthetic scenes of
// tests.
constexpr const char* kPreferredDenoisers[] = {"oidn", "nfor", "rdfc", "pw", "nlm"};
// Severely biased on purpose; never chosen by itself.
constexpr const char* kStressInput = "box";

std::vector<std::string> splitAtPlus(const std::string& text) {
  std::vector<std::string> parts;
  for (size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find('+', begin);
    parts.push_back(text.substr(begin, end == std::string::npos ? end : end - begin));
  }
  return parts;
}

std::string plural(uint64_t count, const char* noun, const char* nouns) {
  return fmt::format("{} {}", count, count == 1 ? noun : nouns);
}

class CombinePlanner {
 public:
  CombinePlanner(const AvailableEstimates& available, const CombinePlanOptions& options)
      : available_(available), options_(options) {}

  // Adds the steps of a method that was named, or reports that the name is an estimate's. Returns why it cannot be an
  // input.
  std::string add(const std::string& name);
  // Marks the steps that are there as helpers alone.
  void markHelpers();
  // Takes out the denoisers of newest images that only stopped methods asked for.
  void dropReplaced(const std::vector<std::string>& wanted);

  CombinePlan combinePlan;

 private:
  void fill(Step& step, const std::string& chosen);
  std::string fillUnbiased(Step& step);
  std::string fillCorrelated(Step& step);
  std::string fillBiased(Step& step, const std::string& chosen);
  std::string fillBases(Step& step, const std::string& chosen);
  bool readsDirectIndirect(const Step& step) const;
  void fillStop(Step& step);
  void addHelper(Step& step, const Needs& needs);
  std::string addStep(const std::string& name);
  std::string defaultBiased(const Step& step, const Needs& needs);
  std::vector<std::string> denoisersInOrder() const;
  std::string lacks(const std::string& estimate, const Needs& needs, bool unbiased) const;

  const AvailableEstimates& available_;
  const CombinePlanOptions& options_;
  std::set<std::string> inProgress_, replaced_, named_;
};

std::string CombinePlanner::add(const std::string& name) {
  named_.insert(name);
  return addStep(name);
}

std::string CombinePlanner::addStep(const std::string& name) {
  if (available_.find(name)) return {};
  if (const Step* done = combinePlan.find(name)) return done->skipReason;
  if (!inProgress_.insert(name).second) return fmt::format("{} would be its own input", name);
  Step step;
  step.name = name;
  const auto [method, chosen] = splitChain(name);
  step.method = findMethod(method);
  fill(step, chosen);
  inProgress_.erase(name);
  const std::string skipReason = step.skipReason;
  combinePlan.steps.push_back(std::move(step));
  return skipReason;
}

void CombinePlanner::fill(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  const bool takesBases = needs.bases > 0 || needs.anyBases;
  if (const auto* external = dynamic_cast<const ExternalMethod*>(step.method.get()))
    step.skipReason = external->skipReason();
  if (step.skipReason.empty()) step.skipReason = fillUnbiased(step);
  if (step.skipReason.empty() && needs.reference && !available_.reference)
    step.skipReason = "needs a reference: combine --reference FILE, or a sweep";
  if (step.skipReason.empty() && needs.correlated) step.skipReason = fillCorrelated(step);
  if (step.skipReason.empty() && needs.biased) step.skipReason = fillBiased(step, chosen);
  if (step.skipReason.empty() && !needs.biased && !takesBases && !chosen.empty())
    step.skipReason = "it takes no biased input";
  if (step.skipReason.empty() && takesBases) step.skipReason = fillBases(step, needs.biased ? "" : chosen);
  if (step.skipReason.empty()) fillStop(step);
  step.directIndirect = step.skipReason.empty() && readsDirectIndirect(step);
}

// What an estimate lacks for the needs, or nothing.
std::string CombinePlanner::lacks(const std::string& name, const Needs& needs, bool unbiased) const {
  const AvailableEstimate* e = available_.find(name);
  if (!e) return {};
  if (needs.halves && !e->halves) return fmt::format("needs the halves of {}", name);
  if (!unbiased) return {};
  if (needs.variance && !e->variance) return fmt::format("needs the variance of {}", name);
  const uint64_t completed = e->unbiased && e->passes == 1 ? 2 : e->passes;  // completed
  if (e->passes > 0 && completed < needs.passes)
    return fmt::format("needs {} of {}, which has {}", plural(needs.passes, "pass", "passes"), name, e->passes);
  if (needs.quarters && !e->quarters) return fmt::format("needs the quarter buffers of {}", name);
  if (e->checkpoints < needs.checkpoints)
    return fmt::format("needs {} of {}, which has {}",
                       plural(static_cast<uint64_t>(needs.checkpoints), "checkpoint", "checkpoints"), name,
                       e->checkpoints);
  return {};
}

std::string CombinePlanner::fillUnbiased(Step& step) {
  step.unbiased = options_.unbiased.empty() ? defaultUnbiased(available_) : options_.unbiased;
  if (step.unbiased.empty()) return "needs an unbiased estimate with independent pixels";
  if (!available_.find(step.unbiased))
    return fmt::format("needs the unbiased estimate {}, which does not exist", step.unbiased);
  return lacks(step.unbiased, step.method->needs(), true);
}

std::string CombinePlanner::fillCorrelated(Step& step) {
  step.correlated = options_.correlated;
  if (step.correlated.empty())
    for (const AvailableEstimate& e : available_.estimates)
      if (e.unbiased && e.correlation != Correlation::Independent) {
        step.correlated = e.name;
        break;
      }
  if (step.correlated.empty()) return "needs an estimate with correlated pixels, such as crn";
  const AvailableEstimate* e = available_.find(step.correlated);
  if (!e) return fmt::format("needs the correlated estimate {}, which does not exist", step.correlated);
  const Needs needs = step.method->needs();
  if (needs.halves && !e->halves) return fmt::format("needs the halves of {}", e->name);
  if (needs.quarters && !e->quarters) return fmt::format("needs the quarter buffers of {}", e->name);
  return {};
}

std::vector<std::string> CombinePlanner::denoisersInOrder() const {
  std::vector<std::string> registered, list;
  for (const auto& m : makeMethods())
    if (m->kind() == MethodKind::Denoiser && std::string(m->name()) != kStressInput) registered.push_back(m->name());
  for (const char* name : kPreferredDenoisers)
    if (std::count(registered.begin(), registered.end(), name)) list.push_back(name);
  for (const std::string& name : registered)
    if (!std::count(list.begin(), list.end(), name)) list.push_back(name);
  return list;
}

std::string CombinePlanner::defaultBiased(const Step& step, const Needs& needs) {
  for (const std::string& name : options_.denoisers)
    if (add(name).empty()) return name;
  if (!needs.redenoise)
    for (const AvailableEstimate& e : available_.estimates)
      if (!e.unbiased && e.name != step.unbiased && lacks(e.name, needs, false).empty()) return e.name;
  for (const std::string& name : denoisersInOrder()) {
    // A trial that leaves no trace of what does not run.
    CombinePlanner trial(available_, options_);
    if (trial.add(name).empty() && add(name).empty()) return name;
  }
  return {};
}

std::string CombinePlanner::fillBiased(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  step.biased = chosen;
  if (step.biased.empty() && !inProgress_.count(options_.biased)) step.biased = options_.biased;
  if (step.biased.empty()) step.biased = defaultBiased(step, needs);
  if (step.biased.empty())
    return needs.redenoise ? "needs a denoiser that can run, for its biased input"
                           : "needs a biased input: a denoiser that can run or a biased estimate";
  const std::string skipReason = add(step.biased);
  if (!skipReason.empty()) return fmt::format("needs {}, which cannot run: {}", step.biased, skipReason);
  const Step* made = combinePlan.find(step.biased);
  if (needs.redenoise && (!made || made->method->kind() != MethodKind::Denoiser))
    return fmt::format("needs a denoiser that it can run again as its biased input; {} is none", step.biased);
  return lacks(step.biased, needs, false);
}

std::string CombinePlanner::fillBases(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  std::vector<std::string> candidates = chosen.empty() ? options_.bases : splitAtPlus(chosen);
  std::string refused;
  const auto keep = [&](const std::string& name) {
    std::string skipReason = add(name);
    if (skipReason.empty()) skipReason = lacks(name, needs, false);
    if (skipReason.empty())
      step.bases.push_back(name);
    else
      refused += fmt::format("; {}: {}", name, skipReason);
  };
  if (!candidates.empty()) {
    for (const std::string& name : candidates) keep(name);
    if (!refused.empty()) return "cannot have all of the bases named" + refused;
  } else {
    for (const std::string& name : options_.denoisers) keep(name);
    if (static_cast<int>(step.bases.size()) < needs.bases)
      for (const std::string& name : denoisersInOrder()) {
        if (std::count(step.bases.begin(), step.bases.end(), name)) continue;
        CombinePlanner trial(available_, options_);
        if (trial.add(name).empty()) keep(name);
      }
  }
  if (needs.anyBases)
    for (const AvailableEstimate& e : available_.estimates)
      if (!e.unbiased && e.name != step.unbiased && !std::count(step.bases.begin(), step.bases.end(), e.name))
        keep(e.name);
  if (static_cast<int>(step.bases.size()) < needs.bases)
    return fmt::format("needs {} to choose from, there {}", plural(static_cast<uint64_t>(needs.bases), "base", "bases"),
                       step.bases.size() == 1 ? "is only " + step.bases[0] : fmt::format("are {}", step.bases.size()));
  if (candidates.empty()) addHelper(step, needs);
  return {};
}

// Of a single pass only one image is taken: another denoiser's, where there is one.
void CombinePlanner::addHelper(Step& step, const Needs& needs) {
  const AvailableEstimate* e = available_.find(step.unbiased);
  if (!options_.helpers || needs.helper.empty() || !e) return;
  const auto photonMaps = std::count_if(step.bases.begin(), step.bases.end(), [&](const std::string& name) {
    const AvailableEstimate* base = available_.find(name);
    return base && base->bias;
  });
  if (e->passes >= (photonMaps > 0 ? needs.helperBelowFused : needs.helperBelow)) return;
  if (std::count(step.bases.begin(), step.bases.end(), needs.helper)) return;
  if (e->passes == 1 && photonMaps < static_cast<ptrdiff_t>(step.bases.size())) return;
  if (addStep(needs.helper).empty()) step.bases.push_back(needs.helper);
}

void CombinePlanner::markHelpers() {
  for (Step& step : combinePlan.steps) step.helper = step.kept == 0 && !named_.count(step.name);
}

bool CombinePlanner::readsDirectIndirect(const Step& step) const {
  const AvailableEstimate* e = available_.find(step.unbiased);
  return step.method->needs().helpful.directIndirect && e && e->directIndirect &&
         std::none_of(step.bases.begin(), step.bases.end(), [&](const std::string& name) {
           const AvailableEstimate* base = available_.find(name);
           return base && base->bias;
         });
}

void CombinePlanner::fillStop(Step& step) {
  const auto* stopping = dynamic_cast<const StoppingMethod*>(step.method.get());
  if (!stopping) return;
  step.stop = stopping->stop() > 0 ? stopping->stop() : options_.stop;
  const AvailableEstimate* e = available_.find(step.unbiased);
  const Step* newest = combinePlan.find(step.biased);
  if (step.stop == 0 || !e || !newest || newest->unbiased != step.unbiased) return;
  const auto kept = std::lower_bound(e->kept.begin(), e->kept.end(), step.stop);
  if (kept == e->kept.end()) {
    if (e->passes > std::bit_ceil(step.stop))
      step.note = fmt::format("denoises the newest image: that of {} after {} passes was not kept", e->name, step.stop);
    return;
  }
  if (*kept >= e->passes) return;  // it is the newest
  Step earlier = *newest;
  earlier.name = fmt::format("{}-stop{}", newest->name, *kept);
  earlier.kept = step.kept = *kept;
  replaced_.insert(newest->name);
  step.biased = earlier.name;
  if (!combinePlan.find(earlier.name)) combinePlan.steps.push_back(std::move(earlier));
}

void CombinePlanner::dropReplaced(const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted) replaced_.erase(name);
  for (const std::string& name : options_.denoisers) replaced_.erase(name);
  for (const Step& step : combinePlan.steps) {
    replaced_.erase(step.biased);
    for (const std::string& base : step.bases) replaced_.erase(base);
  }
  std::erase_if(combinePlan.steps, [&](const Step& step) { return replaced_.count(step.name) > 0; });
}

// What methods find: estimates of a file that earlier runs of methods made give way to the methods of their names, and
// first passes have been completed (completeFirstPasses()).
AvailableEstimates forMethods(const AvailableEstimates& available) {
  AvailableEstimates kept = available;
  std::erase_if(kept.estimates, [](const AvailableEstimate& e) { return isMethod(e.name); });
  for (AvailableEstimate& e : kept.estimates) {
    if (!e.unbiased || e.passes != 1) continue;
    e.halves = e.variance = true;
    e.quarters = e.directIndirect = false;
  }
  return kept;
}

}  // namespace

const Step* CombinePlan::find(const std::string& name) const {
  for (const Step& s : steps)
    if (s.name == name) return &s;
  return nullptr;
}

CombinePlan makeCombinePlan(const AvailableEstimates& available, const std::vector<std::string>& wanted,
                            const CombinePlanOptions& options) {
  const AvailableEstimates kept = forMethods(available);
  CombinePlanner maker(kept, options);
  for (const std::string& name : options.denoisers) maker.add(name);
  for (const std::string& name : wanted) maker.add(name);
  maker.dropReplaced(wanted);
  maker.markHelpers();
  return std::move(maker.combinePlan);
}

KeptBuffers buffersOf(const CombinePlan& combinePlan) {
  KeptBuffers all;
  for (const Step& step : combinePlan.steps) {
    if (!step.skipReason.empty()) continue;
    const Needs needs = step.method->needs();
    KeptBuffers read = needs.helpful;
    read.quarters |= needs.quarters;
    read.history |= needs.checkpoints > 0;
    read.directIndirect = step.directIndirect;
    if (step.stop > 0) read.stops = {step.stop};
    all |= read;
  }
  return all;
}

}  // namespace braid
