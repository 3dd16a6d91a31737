// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace braid {

// Prints the names and descriptions of everything registered; returns exit code 0.
int printLists();

}  // namespace braid
