// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep_method.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "renderer/core/error.h"

namespace braid {

namespace {

bool onePassEach(const SweepMethod& method) {
  return std::all_of(method.inputs.begin(), method.inputs.end(), [](const MethodShare& i) { return i.passes == 1; });
}

bool shareIntegrator(const SweepMethod& a, const SweepMethod& b) {
  return std::any_of(a.inputs.begin(), a.inputs.end(), [&](const MethodShare& i) {
    return std::find(b.inputs.begin(), b.inputs.end(), i) != b.inputs.end();
  });
}

}  // namespace

std::vector<SweepMethod> integratorMethods(const std::vector<const Integrator*>& integrators) {
  std::vector<SweepMethod> methods;
  for (const Integrator* i : integrators) {
    SweepMethod method;
    method.name = i->name();
    method.inputs = {{i->name(), 1}};
    methods.push_back(method);
  }
  return methods;
}

std::vector<SweepMethod> chooseMethods(const std::vector<std::string>& names, const std::vector<SweepMethod>& known) {
  std::vector<SweepMethod> chosen;
  const auto named = [](const std::string& name) { return [name](const SweepMethod& r) { return r.name == name; }; };
  for (const std::string& name : names) {
    if (std::any_of(chosen.begin(), chosen.end(), named(name))) continue;
    const auto found = std::find_if(known.begin(), known.end(), named(name));
    if (found == known.end()) {
      std::string list;
      for (const SweepMethod& r : known) list += (list.empty() ? "" : ", ") + r.name;
      throw Error(ExitCode::Usage, fmt::format("--methods: unknown method '{}': known are {}", name, list));
    }
    chosen.push_back(*found);
  }
  if (chosen.empty()) throw Error(ExitCode::Usage, "--methods: name at least one method");
  return chosen;
}

std::vector<std::vector<size_t>> groupMethods(const std::vector<SweepMethod>& methods, bool equalTime) {
  const auto together = [&](const SweepMethod& a, const SweepMethod& b) {
    if (a.inputs == b.inputs) return true;
    return !equalTime && onePassEach(a) && onePassEach(b) && shareIntegrator(a, b);
  };
  // Connected components: every method takes the smallest label among those it belongs together with.
  std::vector<size_t> label(methods.size());
  std::iota(label.begin(), label.end(), size_t(0));
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t i = 0; i < methods.size(); ++i)
      for (size_t j = 0; j < methods.size(); ++j)
        if (label[j] < label[i] && together(methods[i], methods[j])) {
          label[i] = label[j];
          changed = true;
        }
  }
  std::vector<std::vector<size_t>> groups;
  for (size_t root = 0; root < methods.size(); ++root) {
    std::vector<size_t> members;
    for (size_t i = 0; i < methods.size(); ++i)
      if (label[i] == root) members.push_back(i);
    if (!members.empty()) groups.push_back(std::move(members));
  }
  return groups;
}

}  // namespace braid
