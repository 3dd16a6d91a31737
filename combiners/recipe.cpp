// SPDX-License-Identifier: Apache-2.0
#include "combiners/recipe.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <filesystem>
#include <set>

#include <fmt/format.h>

#include "combiners/curves_stop.h"
#include "combiners/outside_method.h"
#include "combiners/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/hash.h"

namespace braid {

namespace {

// Best first: the learned one, the regressions, then the non-local filters by their error on the synthetic scenes of
// tests.
constexpr const char* kPreferredDenoisers[] = {"oidn", "nfor", "rdfc", "pw", "nlm"};
// Severely biased on purpose; never chosen by itself.
constexpr const char* kStressInput = "box";

// "name@biased" cut at the first '@' that is no part of a parameter, which a number never has.
std::pair<std::string, std::string> splitChain(const std::string& name) {
  const size_t at = name.find('@'), colon = name.find(':');
  if (at == std::string::npos) return {name, ""};
  if (colon < at && name.find_first_not_of("0123456789", colon + 1) != at) return {name, ""};
  return {name.substr(0, at), name.substr(at + 1)};
}

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

class RecipeMaker {
 public:
  RecipeMaker(const Facts& facts, const RecipeOptions& options) : facts_(facts), options_(options) {}

  // Adds the steps of a method, or reports that the name is an estimate's. Returns why it cannot be an input.
  std::string add(const std::string& name);
  // Takes out the denoisers of newest images that only stopped methods asked for.
  void dropReplaced(const std::vector<std::string>& wanted);

  Recipe recipe;

 private:
  void fill(Step& step, const std::string& chosen);
  std::string fillUnbiased(Step& step);
  std::string fillCorrelated(Step& step);
  std::string fillBiased(Step& step, const std::string& chosen);
  std::string fillBases(Step& step, const std::string& chosen);
  bool readsLightParts(const Step& step) const;
  void fillStop(Step& step);
  std::string defaultBiased(const Step& step, const Needs& needs);
  std::vector<std::string> denoisersInOrder() const;
  std::string lacks(const std::string& estimate, const Needs& needs, bool unbiased) const;

  const Facts& facts_;
  const RecipeOptions& options_;
  std::set<std::string> inProgress_, replaced_;
};

std::string RecipeMaker::add(const std::string& name) {
  if (facts_.find(name)) return {};
  if (const Step* done = recipe.find(name)) return done->obstacle;
  if (!inProgress_.insert(name).second) return fmt::format("{} would be its own input", name);
  Step step;
  step.name = name;
  const auto [method, chosen] = splitChain(name);
  step.method = findMethod(method);
  fill(step, chosen);
  inProgress_.erase(name);
  const std::string obstacle = step.obstacle;
  recipe.steps.push_back(std::move(step));
  return obstacle;
}

void RecipeMaker::fill(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  const bool takesBases = needs.bases > 0 || needs.anyBases;
  if (const auto* outside = dynamic_cast<const OutsideMethod*>(step.method.get())) step.obstacle = outside->obstacle();
  if (step.obstacle.empty()) step.obstacle = fillUnbiased(step);
  if (step.obstacle.empty() && needs.reference && !facts_.reference)
    step.obstacle = "needs a reference: combine --reference FILE, or a sweep";
  if (step.obstacle.empty() && needs.correlated) step.obstacle = fillCorrelated(step);
  if (step.obstacle.empty() && needs.biased) step.obstacle = fillBiased(step, chosen);
  if (step.obstacle.empty() && !needs.biased && !takesBases && !chosen.empty())
    step.obstacle = "it takes no biased input";
  if (step.obstacle.empty() && takesBases) step.obstacle = fillBases(step, needs.biased ? "" : chosen);
  if (step.obstacle.empty()) fillStop(step);
  step.lightParts = step.obstacle.empty() && readsLightParts(step);
}

// What an estimate lacks for the needs, or nothing.
std::string RecipeMaker::lacks(const std::string& name, const Needs& needs, bool unbiased) const {
  const EstimateFacts* e = facts_.find(name);
  if (!e) return {};
  if (needs.halves && !e->halves) return fmt::format("needs the halves of {}", name);
  if (!unbiased) return {};
  if (needs.variance && !e->variance) return fmt::format("needs the variance of {}", name);
  if (e->passes > 0 && e->passes < needs.passes)
    return fmt::format("needs {} of {}, which has {}", plural(needs.passes, "pass", "passes"), name, e->passes);
  if (needs.quarters && !e->quarters) return fmt::format("needs the quarter buffers of {}", name);
  if (e->checkpoints < needs.checkpoints)
    return fmt::format("needs {} of {}, which has {}",
                       plural(static_cast<uint64_t>(needs.checkpoints), "checkpoint", "checkpoints"), name,
                       e->checkpoints);
  return {};
}

std::string RecipeMaker::fillUnbiased(Step& step) {
  step.unbiased = options_.unbiased.empty() ? defaultUnbiased(facts_) : options_.unbiased;
  if (step.unbiased.empty()) return "needs an unbiased estimate with independent pixels";
  if (!facts_.find(step.unbiased))
    return fmt::format("needs the unbiased estimate {}, which there is not", step.unbiased);
  return lacks(step.unbiased, step.method->needs(), true);
}

std::string RecipeMaker::fillCorrelated(Step& step) {
  step.correlated = options_.correlated;
  if (step.correlated.empty())
    for (const EstimateFacts& e : facts_.estimates)
      if (e.unbiased && e.correlation != Correlation::Independent) {
        step.correlated = e.name;
        break;
      }
  if (step.correlated.empty()) return "needs an estimate with correlated pixels, such as crn";
  const EstimateFacts* e = facts_.find(step.correlated);
  if (!e) return fmt::format("needs the correlated estimate {}, which there is not", step.correlated);
  const Needs needs = step.method->needs();
  if (needs.halves && !e->halves) return fmt::format("needs the halves of {}", e->name);
  if (needs.quarters && !e->quarters) return fmt::format("needs the quarter buffers of {}", e->name);
  return {};
}

std::vector<std::string> RecipeMaker::denoisersInOrder() const {
  std::vector<std::string> registered, list;
  for (const auto& m : makeMethods())
    if (m->kind() == MethodKind::Denoiser && std::string(m->name()) != kStressInput) registered.push_back(m->name());
  for (const char* name : kPreferredDenoisers)
    if (std::count(registered.begin(), registered.end(), name)) list.push_back(name);
  for (const std::string& name : registered)
    if (!std::count(list.begin(), list.end(), name)) list.push_back(name);
  return list;
}

std::string RecipeMaker::defaultBiased(const Step& step, const Needs& needs) {
  for (const std::string& name : options_.denoisers)
    if (add(name).empty()) return name;
  if (!needs.redenoise)
    for (const EstimateFacts& e : facts_.estimates)
      if (!e.unbiased && e.name != step.unbiased && lacks(e.name, needs, false).empty()) return e.name;
  for (const std::string& name : denoisersInOrder()) {
    // A trial that leaves no trace of what does not run.
    RecipeMaker trial(facts_, options_);
    if (trial.add(name).empty() && add(name).empty()) return name;
  }
  return {};
}

std::string RecipeMaker::fillBiased(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  step.biased = chosen;
  if (step.biased.empty() && !inProgress_.count(options_.biased)) step.biased = options_.biased;
  if (step.biased.empty()) step.biased = defaultBiased(step, needs);
  if (step.biased.empty())
    return needs.redenoise ? "needs a denoiser that can run, for its biased input"
                           : "needs a biased input: a denoiser that can run or a biased estimate";
  const std::string obstacle = add(step.biased);
  if (!obstacle.empty()) return fmt::format("needs {}, which cannot run: {}", step.biased, obstacle);
  const Step* made = recipe.find(step.biased);
  if (needs.redenoise && (!made || made->method->kind() != MethodKind::Denoiser))
    return fmt::format("needs a denoiser that it can run again as its biased input; {} is none", step.biased);
  return lacks(step.biased, needs, false);
}

std::string RecipeMaker::fillBases(Step& step, const std::string& chosen) {
  const Needs needs = step.method->needs();
  std::vector<std::string> candidates = chosen.empty() ? options_.bases : splitAtPlus(chosen);
  std::string refused;
  const auto keep = [&](const std::string& name) {
    std::string obstacle = add(name);
    if (obstacle.empty()) obstacle = lacks(name, needs, false);
    if (obstacle.empty())
      step.bases.push_back(name);
    else
      refused += fmt::format("; {}: {}", name, obstacle);
  };
  if (!candidates.empty()) {
    for (const std::string& name : candidates) keep(name);
    if (!refused.empty()) return "cannot have all of the bases named" + refused;
  } else {
    for (const std::string& name : options_.denoisers) keep(name);
    if (static_cast<int>(step.bases.size()) < needs.bases)
      for (const std::string& name : denoisersInOrder()) {
        if (std::count(step.bases.begin(), step.bases.end(), name)) continue;
        RecipeMaker trial(facts_, options_);
        if (trial.add(name).empty()) keep(name);
      }
  }
  if (needs.anyBases)
    for (const EstimateFacts& e : facts_.estimates)
      if (!e.unbiased && e.name != step.unbiased && !std::count(step.bases.begin(), step.bases.end(), e.name))
        keep(e.name);
  if (static_cast<int>(step.bases.size()) < needs.bases)
    return fmt::format("needs {} to choose from, there {}", plural(static_cast<uint64_t>(needs.bases), "base", "bases"),
                       step.bases.size() == 1 ? "is only " + step.bases[0] : fmt::format("are {}", step.bases.size()));
  return {};
}

bool RecipeMaker::readsLightParts(const Step& step) const {
  const EstimateFacts* e = facts_.find(step.unbiased);
  return step.method->needs().lightPartsHelp && e && e->lightParts &&
         std::none_of(step.bases.begin(), step.bases.end(), [&](const std::string& name) {
           const EstimateFacts* base = facts_.find(name);
           return base && base->bias;
         });
}

void RecipeMaker::fillStop(Step& step) {
  const auto* stopping = dynamic_cast<const StoppingMethod*>(step.method.get());
  if (!stopping) return;
  step.stop = stopping->stop() > 0 ? stopping->stop() : options_.stop;
  const EstimateFacts* e = facts_.find(step.unbiased);
  const Step* newest = recipe.find(step.biased);
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
  if (!recipe.find(earlier.name)) recipe.steps.push_back(std::move(earlier));
}

void RecipeMaker::dropReplaced(const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted) replaced_.erase(name);
  for (const std::string& name : options_.denoisers) replaced_.erase(name);
  for (const Step& step : recipe.steps) {
    replaced_.erase(step.biased);
    for (const std::string& base : step.bases) replaced_.erase(base);
  }
  std::erase_if(recipe.steps, [&](const Step& step) { return replaced_.count(step.name) > 0; });
}

// Estimates of a file that earlier runs of methods made give way to the methods of their names.
Facts withoutMethods(const Facts& facts) {
  Facts kept = facts;
  std::erase_if(kept.estimates, [](const EstimateFacts& e) { return isMethod(e.name); });
  return kept;
}

// The method for what follows the colon.
std::unique_ptr<Method> withStop(const StoppingMethod& method, const std::string& full, size_t begin) {
  uint64_t passes = 0;
  const char *at = full.data() + begin, *end = full.data() + full.size();
  const auto [next, error] = std::from_chars(at, end, passes);
  if (at == end || error != std::errc() || next != end || passes == 0)
    throw Error(ExitCode::Usage, fmt::format("{}: expected {}:PASSES, after which denoising stops, such as {}:128",
                                             full, method.name(), method.name()));
  return method.stoppedAfter(passes);
}

std::string knownMethods() {
  std::string known;
  for (const auto& m : makeMethods()) known += fmt::format("{}{}", known.empty() ? "" : ", ", m->name());
  return known;
}

}  // namespace

const EstimateFacts* Facts::find(const std::string& name) const {
  for (const EstimateFacts& e : estimates)
    if (e.name == name) return &e;
  return nullptr;
}

Facts factsOf(const Estimates& all) {
  Facts facts;
  facts.features = all.features.has_value();
  facts.reference = !all.reference.empty();
  for (const Estimate& e : all.estimates) {
    const auto history = all.history.find(e.name);
    std::vector<uint64_t> kept;
    if (history != all.history.end())
      for (const Checkpoint& c : history->second)
        if (!c.mean.empty() && c.passes >= 2) kept.push_back(c.passes);
    facts.estimates.push_back({e.name, e.unbiased, e.correlation, e.passes, !e.half[0].empty() && !e.half[1].empty(),
                               !e.variance.empty(), e.quarter.size() == 4 && (e.passes == 0 || e.passes >= 4),
                               history == all.history.end() ? 0 : static_cast<int>(history->second.size()),
                               std::move(kept), !e.bias.empty(), !e.direct.mean.empty()});
  }
  return facts;
}

std::string defaultUnbiased(const Facts& facts) {
  const auto first = [&](const auto& fits) {
    for (const EstimateFacts& e : facts.estimates)
      if (e.correlation == Correlation::Independent && fits(e)) return e.name;
    return std::string();
  };
  const std::string unbiased = first([](const EstimateFacts& e) { return e.unbiased; });
  if (!unbiased.empty()) return unbiased;
  return first([](const EstimateFacts& e) { return e.halves && e.variance && !e.bias && !isMethod(e.name); });
}

const Step* Recipe::find(const std::string& name) const {
  for (const Step& s : steps)
    if (s.name == name) return &s;
  return nullptr;
}

Recipe makeRecipe(const Facts& facts, const std::vector<std::string>& wanted, const RecipeOptions& options) {
  const Facts kept = withoutMethods(facts);
  RecipeMaker maker(kept, options);
  for (const std::string& name : options.denoisers) maker.add(name);
  for (const std::string& name : wanted) maker.add(name);
  maker.dropReplaced(wanted);
  return std::move(maker.recipe);
}

RecipeNeeds needsOf(const Recipe& recipe) {
  RecipeNeeds all;
  for (const Step& step : recipe.steps) {
    if (!step.obstacle.empty()) continue;
    const Needs needs = step.method->needs();
    all.quarters |= needs.quarters || needs.quartersHelp;
    all.features |= needs.features;
    all.featureNoise |= needs.featureNoise;
    all.lightParts |= step.lightParts;
    all.checkpoints = std::max(all.checkpoints, needs.checkpoints);
    if (step.stop > 0) all.stops.push_back(step.stop);
  }
  std::sort(all.stops.begin(), all.stops.end());
  all.stops.erase(std::unique(all.stops.begin(), all.stops.end()), all.stops.end());
  return all;
}

bool isMethod(const std::string& name) {
  const auto methods = makeMethods();
  return std::any_of(methods.begin(), methods.end(), [&](const auto& m) { return name == m->name(); });
}

std::shared_ptr<const Method> findMethod(const std::string& full) {
  const size_t colon = full.find(':');
  const std::string name = full.substr(0, colon);
  for (auto& m : makeMethods()) {
    if (name != m->name()) continue;
    if (colon == std::string::npos) return std::shared_ptr<const Method>(std::move(m));
    const auto* outside = dynamic_cast<const OutsideMethod*>(m.get());
    const auto* stopping = dynamic_cast<const StoppingMethod*>(m.get());
    auto made = outside    ? outside->with(full.substr(colon + 1))
                : stopping ? withStop(*stopping, full, colon + 1)
                           : nullptr;
    if (!made) throw Error(ExitCode::Usage, fmt::format("{}: {} takes no parameter after a colon", full, name));
    return std::shared_ptr<const Method>(std::move(made));
  }
  throw Error(ExitCode::Usage, fmt::format("unknown method '{}': known are {}", name, knownMethods()));
}

std::vector<OptionInfo> allMethodOptions() {
  std::vector<OptionInfo> all;
  for (const auto& m : makeMethods())
    for (const OptionInfo& option : m->options())
      if (std::none_of(all.begin(), all.end(), [&](const OptionInfo& o) { return o.name == option.name; }))
        all.push_back(option);
  return all;
}

std::string layerName(const std::string& name) {
  const size_t colon = name.find(':');
  std::string text = name.substr(0, colon);
  if (colon != std::string::npos) {
    std::string file = name.substr(colon + 1, name.find(':', colon + 1) - colon - 1), more;
    if (text.ends_with("external-command")) {  // the program, and what tells commands of one program apart
      ContentHash hash;
      hash.add(name);
      file = file.substr(file.find_first_not_of("' "));
      file = file.substr(0, file.find_first_of("' "));
      more = "-" + hexString(hash.value()).substr(0, 4);
    }
    text.append("-").append(std::filesystem::path(file).stem().string()).append(more);
  }
  std::replace(text.begin(), text.end(), '.', '-');
  return text;
}

}  // namespace braid
