// SPDX-License-Identifier: Apache-2.0
#include "tools/sweep/methods/sweep_method.h"

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
  const auto shareRender = [&](const SweepMethod& a, const SweepMethod& b) {
    return a.inputs == b.inputs || (!equalTime && onePassEach(a) && onePassEach(b) && shareIntegrator(a, b));
  };
  // Those that read features, and those that do not, among themselves. Connected components: every method takes the
  // smallest label among those it belongs together with.
  std::vector<size_t> label(methods.size());
  std::iota(label.begin(), label.end(), size_t(0));
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t i = 0; i < methods.size(); ++i)
      for (size_t j = 0; j < methods.size(); ++j) {
        const SweepMethod &a = methods[i], &b = methods[j];
        const bool alike =
            a.buffers.features == b.buffers.features && (!a.buffers.features || a.inputs.front() == b.inputs.front());
        if (label[j] >= label[i] || !alike || !shareRender(a, b)) continue;
        label[i] = label[j];
        changed = true;
      }
  }
  // Whoever reads no features joins the first of the others that shares a render with one of its group.
  for (size_t i = 0; i < methods.size(); ++i) {
    const auto readsFeatures = [&](size_t j) { return methods[j].buffers.features && label[j] == label[i]; };
    bool hosted = false;
    for (size_t j = 0; j < methods.size(); ++j) hosted = hosted || readsFeatures(j);
    if (hosted) continue;
    const auto host = std::find_if(methods.begin(), methods.end(), [&](const SweepMethod& m) {
      return m.buffers.features && shareRender(m, methods[i]);
    });
    if (host == methods.end()) continue;
    const size_t from = label[i], to = label[static_cast<size_t>(host - methods.begin())];
    std::replace(label.begin(), label.end(), from, to);
  }
  std::vector<std::vector<size_t>> groups(methods.size());
  std::vector<size_t> order;  // of the labels, by their first methods
  for (size_t i = 0; i < methods.size(); ++i) {
    if (groups[label[i]].empty()) order.push_back(label[i]);
    groups[label[i]].push_back(i);
  }
  std::vector<std::vector<size_t>> out;
  for (const size_t l : order) out.push_back(std::move(groups[l]));
  return out;
}

}  // namespace braid
