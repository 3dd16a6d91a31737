// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/registry.h"

namespace braid {

std::vector<std::unique_ptr<Method>> makeMethods() {
  std::vector<std::unique_ptr<Method>> list;
#define METHOD(name) list.push_back(make_##name());
#include "combiners/list.def"
#undef METHOD
  return list;
}

}  // namespace braid
