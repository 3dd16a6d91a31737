// SPDX-License-Identifier: Apache-2.0
// How many rows of an EXR file are compressed at once: a ZIP block of 16 rows for every thread.
#pragma once

#include <algorithm>

#include "renderer/core/parallel.h"

namespace braid {

inline int exrRowsPerWrite() { return 16 * std::max(8, machineThreads()); }

}  // namespace braid
