// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/sweep_inputs.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/options/file_uses.h"
#include "tools/sweep/sweep_reference.h"

namespace braid {

namespace {

namespace fs = std::filesystem;

// Whether the method or an input of it is the fixed image of a file: external:FILE.
bool readsFile(const std::string& method) {
  const std::string name = "external:";
  for (size_t at = method.find(name); at != std::string::npos; at = method.find(name, at + 1))
    if (at == 0 || std::string("@+/").find(method[at - 1]) != std::string::npos) return true;
  return false;
}

void checkNumbers(const SweepOptions& o) {
  if (o.seeds < 1) throw Error(ExitCode::Usage, "--seeds: at least 1");
  if (o.seed >= kReferenceSeed - static_cast<uint64_t>(o.seeds))
    throw Error(ExitCode::Usage, "--seed: below 2^63; references use the seeds from there on");
  if (!(o.cropWorst >= 0 && o.cropWorst < 1))
    throw Error(ExitCode::Usage, "--crop-worst: a fraction of the pixels, from 0 to below 1");
}

void checkFixedImages(const SweepOptions& o, const std::vector<SweepMethod>& methods, size_t rungs) {
  for (const SweepMethod& method : methods)
    if (readsFile(method.name) && (rungs > 1 || o.scenes.size() > 1))
      throw Error(
          ExitCode::Usage,
          fmt::format("--methods: {}: one image cannot stand for {}: it would be compared everywhere as if it had "
                      "been made there; give one scene and one rung, or external-command:'COMMAND {{color}} "
                      "{{albedo}} {{normal}} {{out}}'",
                      method.name,
                      rungs > 1 ? fmt::format("{} rungs", rungs) : fmt::format("{} scenes", o.scenes.size())));
}

void checkReferences(const SweepOptions& o, const std::vector<std::string>& names,
                     const std::vector<const Integrator*>& integrators) {
  for (const auto* list : {&o.references, &o.referenceIntegrators})
    for (const std::string& item : *list) {
      const std::string scene = item.substr(0, item.find('='));
      if (item.find('=') != std::string::npos && std::find(names.begin(), names.end(), scene) == names.end())
        throw Error(ExitCode::Usage, fmt::format("'{}': no scene of the sweep is called {}", item, scene));
    }
  for (const std::string& name : names) {
    const std::string file = valueForScene(o.references, name, ""),
                      integrator = valueForScene(o.referenceIntegrators, name, "pt");
    if (!file.empty() && !fs::exists(file)) throw Error(ExitCode::BadInput, file + ": no such reference");
    const bool known =
        integrator == "auto" || std::any_of(integrators.begin(), integrators.end(),
                                            [&](const Integrator* i) { return i->name() == integrator; });
    if (!known) throw Error(ExitCode::Usage, fmt::format("--reference-integrator: no integrator '{}'", integrator));
  }
}

}  // namespace

void checkSweepInputs(const SweepOptions& o, const std::vector<std::string>& names,
                      const std::vector<SweepMethod>& methods, const std::vector<const Integrator*>& integrators,
                      size_t rungs) {
  checkNumbers(o);
  checkFixedImages(o, methods, rungs);
  for (const std::string& file : o.scenes)
    if (!fs::exists(file)) throw Error(ExitCode::BadInput, file + ": no such file");
  if (const std::string& file = o.view.environment; !file.empty() && !fs::exists(file))
    throw Error(ExitCode::BadInput, file + ": no such environment");
  checkReferences(o, names, integrators);
}

void checkSweepOutputs(const SweepOptions& o, const std::vector<std::string>& names) {
  FileUses uses;
  for (const char* name : {"sweep.csv", "sweep.json", "summary.md", "report.html"})
    uses.output("-o", o.output + "/" + name);
  std::vector<std::string> inputs = o.scenes;
  for (const std::string& file : o.scenes) uses.scene(file, o.view.environment);
  if (!o.view.environment.empty()) inputs.push_back(o.view.environment);
  for (const std::string& name : names)
    if (const std::string file = valueForScene(o.references, name, ""); !file.empty()) {
      uses.input("a reference", file);
      inputs.push_back(file);
    }
  uses.check();
  for (const std::string& file : inputs)
    for (const char* name : {"images", "plots"})
      if (const std::string folder = o.output + "/" + name; isWithin(file, folder))
        throw Error(ExitCode::Usage,
                    fmt::format("-o {}: the sweep writes into {}, where its input {} lies: choose another folder",
                                o.output, folder, file));
}

}  // namespace braid
