// SPDX-License-Identifier: Apache-2.0
// The table of denoisers and combiners, expanded from list.def.
#pragma once

#include <memory>
#include <vector>

#include "combiners/method.h"

namespace braid {

#define METHOD(name) std::unique_ptr<Method> make_##name();
#include "combiners/list.def"
#undef METHOD

// One of each, in the order of list.def.
std::vector<std::unique_ptr<Method>> makeMethods();

}  // namespace braid
