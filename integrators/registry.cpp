// SPDX-License-Identifier: Apache-2.0
#include "integrators/registry.h"

namespace braid {

std::vector<std::unique_ptr<Integrator>> makeIntegrators() {
  std::vector<std::unique_ptr<Integrator>> list;
#define INTEGRATOR(name) list.push_back(make_##name());
#include "integrators/list.def"
#undef INTEGRATOR
  return list;
}

std::vector<const Integrator*> pointersTo(const std::vector<std::unique_ptr<Integrator>>& integrators) {
  std::vector<const Integrator*> pointers;
  for (const auto& i : integrators) pointers.push_back(i.get());
  return pointers;
}

}  // namespace braid
