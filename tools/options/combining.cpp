// SPDX-License-Identifier: Apache-2.0
#include "tools/options/combining.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "braid/plan_combining.h"
#include "combiners/learned/network_place.h"
#include "combiners/denoise/oidn/oidn_networks.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/denoise_cutoff.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "combiners/statistics/error_map.h"
#include "renderer/film/make_attribute.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/syntax/option_texts.h"

namespace braid {

namespace {

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

}  // namespace

std::string CombineChoice::text() const { return methods.empty() ? "none" : joinList(methods); }

std::vector<std::string> CombineChoice::names() const {
  std::vector<std::string> all = methods;
  all.insert(all.end(), denoisers.begin(), denoisers.end());
  all.insert(all.end(), bases.begin(), bases.end());
  if (!biased.empty()) all.push_back(biased);
  return all;
}

std::vector<std::string> parseMethods(const std::string& text) {
  return text == "none" ? std::vector<std::string>{} : splitList(text);
}

PipelineOptions CombineChoice::options(const std::atomic<bool>* cancel) const {
  PipelineOptions o;
  o.roles.biased = biased;
  o.roles.bases = bases;
  o.roles.denoisers = denoisers;
  o.roles.helpers = helpers;
  o.cancel = cancel;
  const std::vector<OptionInfo> infos = allMethodOptions();
  for (size_t i = 0; i < numbers.size() && i < infos.size(); ++i)
    if (!std::isnan(numbers[i])) o.numbers.set(infos[i].name, numbers[i]);
  o.roles.stop = stopPasses(o.numbers.number(kCurvesStop));
  return o;
}

void addCombineOptions(CLI::App& command, CombineChoice& c) {
  addList(command, "--denoiser", c.denoisers,
          "Denoisers to run and keep, separated by commas, the preferred one first");
  command
      .add_option("--biased", c.biased,
                  "Biased input of combiners: an estimate, a denoiser or another combiner (--list)")
      ->type_name("NAME");
  addList(command, "--bases", c.bases, "Images that ensembles choose from, by name, separated by commas");
  command.add_flag_callback(
      "--no-helpers", [&c] { c.helpers = false; },
      "Combine without denoisers that were not named: auto takes kpn below 256 samples");
  command.add_flag("--weights", c.weights, "Also write the maps of weights that combiners worked out");
  const std::vector<OptionInfo> infos = allMethodOptions();
  c.numbers.assign(infos.size(), std::numeric_limits<double>::quiet_NaN());
  for (size_t i = 0; i < infos.size(); ++i)
    command
        .add_option_function<double>(
            "--" + infos[i].name, [&c, i](const double& value) { c.numbers[i] = value; },
            fmt::format("{} (default {})", infos[i].description, infos[i].fallback))
        ->check(numberOf(infos[i]))
        ->group(kMethodOptions);
  command
      .add_option_function<std::string>("--oidn-weights", nameOidnWeights,
                                        "Folder of the weights of oidn, which are preferred to its library then "
                                        "(default: BRAID_OIDN_WEIGHTS, or where tools/setup oidn puts them)")
      ->type_name("FOLDER")
      ->group(kMethodOptions);
  for (const char* method : {"kpn", "js-neural", "double-shrinkage-neural"})
    command
        .add_option_function<std::string>(
            fmt::format("--{}-network", method), [method](const std::string& file) { nameNetwork(method, file); },
            fmt::format("Network of {} (default: {}, or the one that comes with braid)", method,
                        networkVariable(method)))
        ->type_name("FILE")
        ->group(kMethodOptions);
}

void combineByDefault(CombineChoice& choice) {
  choice.methods = {kDefaultMethod};
  choice.asked = false;
}

void noteWhoAsked(const CLI::App& command, CombineChoice& choice) {
  choice.asked = command.get_option("--combine")->count() > 0;
}

CombinePlan planCombining(const CombineChoice& choice, uint64_t samples, Plan& plan) {
  if (choice.methods.empty() && choice.denoisers.empty()) return {};
  return planMethods(choice.methods, choice.options().roles, samples, plan);
}

std::string combinePlanText(const CombinePlan& combinePlan) {
  std::string text;
  for (const Step& s : combinePlan.steps) {
    if (!s.skipReason.empty()) {
      text += fmt::format("- {}: {}\n", s.name, s.skipReason);
      continue;
    }
    std::vector<std::string> inputs{s.unbiased};
    for (const std::string& name : {s.correlated, s.biased})
      if (!name.empty()) inputs.push_back(name);
    inputs.insert(inputs.end(), s.bases.begin(), s.bases.end());
    text += fmt::format("+ {}: of {}\n", s.name, join(inputs));
  }
  return text;
}

PipelineResult runCombining(const Estimates& estimates, const CombineChoice& choice, const PipelineOptions& options,
                            int threads) {
  if (choice.methods.empty() && choice.denoisers.empty()) return {};
  PipelineResult result;
  withThreads(threads, [&] { result = runPipeline(estimates, choice.methods, options); });
  return result;
}

void requireRunnable(const CombinePlan& combinePlan, const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted)
    if (const Step* step = combinePlan.find(name); step && !step->skipReason.empty())
      throw Error(ExitCode::Usage, fmt::format("{} cannot run: {}", name, step->skipReason));
}

CombinedLayers::CombinedLayers(const PipelineResult& result, const std::vector<std::string>& wanted, bool weights,
                               bool timing, Estimates& estimates) {
  const PipelineOutput* last = nullptr;
  for (const PipelineOutput& out : result.outputs) {
    if (!out.ran()) continue;
    const std::vector<Attribute> remarks = remarksOf(out, timing);
    estimates.attributes.insert(estimates.attributes.end(), remarks.begin(), remarks.end());
    // An image of fewer passes would be taken for that of all in the file, and nobody asked for a helper's.
    if (out.step.method->kind() == MethodKind::Denoiser && out.step.kept == 0 && !out.step.helper) {
      Estimate e = out.result.image;
      e.name = layerName(out.step.name);
      std::erase_if(estimates.estimates, [&](const Estimate& old) { return old.name == e.name; });
      const std::string prefix = "braid/" + e.name + "/";
      std::erase_if(estimates.attributes,
                    [&](const Attribute& a) { return a.name == prefix + "unbiased" || a.name == prefix + "passes"; });
      estimates.attributes.push_back(wholeAttribute(prefix + "unbiased", 0));
      estimates.attributes.push_back(wholeAttribute(prefix + "passes", static_cast<int64_t>(e.passes)));
      estimates.estimates.push_back(std::move(e));
    }
    if (weights)
      for (const NamedPlane& p : out.result.aovs) add(p.name, nullptr, &p.plane);
  }
  for (const std::string& name : wanted) {
    const PipelineOutput* out = result.find(name);
    if (!out || !out->ran()) continue;
    last = out;
    add("combined." + layerName(name), &out->result.image.mean, nullptr);
  }
  if (!last) {
    // An integrator is the headline.
    if (!estimates.estimates.empty() && knowsError(estimates.estimates.front())) {
      integratorsError_ = errorMap(estimates.estimates.front());
      add("Error", nullptr, &integratorsError_);
    }
    return;
  }
  headline_ = &last->result.image.mean;
  if (!last->result.error.empty()) add("Error", nullptr, &last->result.error);
  estimates.attributes.push_back(textAttribute("braid/headline", "combined." + layerName(last->step.name)));
  estimates.attributes.push_back(numberAttribute("braid/exposure", result.exposure));
}

void CombinedLayers::add(const std::string& name, const Rgb<float>* image, const Plane<float>* plane) {
  if (std::none_of(list_.begin(), list_.end(), [&](const ExrLayer& l) { return l.name == name; }))
    list_.push_back({name, image, plane});
}

std::vector<std::string> combineWarnings(const PipelineResult& result, bool asked) {
  std::vector<std::string> lines;
  const SanitiseReport& s = result.sanitised;
  if (s.nonFinite > 0)
    lines.push_back(
        fmt::format("inputs of combiners: {} values are not finite and have no weight: {} pixels of colours are filled "
                    "from the other half or their neighbours",
                    s.nonFinite, s.filled));
  if (s.negativeVariance > 0 || s.outOfRange > 0)
    lines.push_back(fmt::format("inputs of combiners: {} negative variances count as 0, {} values were limited",
                                s.negativeVariance, s.outOfRange));
  for (const PipelineOutput& out : result.outputs) {
    if (!out.ran() && (out.step.helper ? out.failed : asked))
      lines.push_back(fmt::format("{} did not run: {}", out.step.name, out.step.skipReason));
    if (!out.step.note.empty()) lines.push_back(fmt::format("{} {}", out.step.name, out.step.note));
  }
  return lines;
}

}  // namespace braid
