// SPDX-License-Identifier: Apache-2.0
#include "tools/commands/lists.h"

#include <fmt/format.h>

#include "combiners/pipeline/registry.h"
#include "integrators/registry.h"
#include "tools/metrics/metrics.h"

namespace braid {

int printLists() {
  fmt::print("integrators\n");
  for (const auto& i : makeIntegrators()) fmt::print("  {:<12} {}\n", i->name(), i->description());
  for (const auto& [kind, title] :
       {std::pair(MethodKind::Denoiser, "denoisers"), {MethodKind::Combiner, "combiners"}}) {
    fmt::print("{}\n", title);
    for (const auto& m : makeMethods())
      if (m->kind() == kind) fmt::print("  {:<18} {}\n", m->name(), m->description());
  }
  fmt::print("metrics\n");
  for (const Metric& m : metricRegistry()) fmt::print("  {:<12} {}\n", m.name, m.description);
  return 0;
}

}  // namespace braid
