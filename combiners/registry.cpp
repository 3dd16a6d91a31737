// SPDX-License-Identifier: Apache-2.0
#include "combiners/registry.h"

namespace braid {

std::vector<std::unique_ptr<Method>> makeMethods() {
  std::vector<std::unique_ptr<Method>> list;
#define COMBINER(name) list.push_back(make_##name());
#include "combiners/list.def"
#undef COMBINER
  return list;
}

}  // namespace braid
