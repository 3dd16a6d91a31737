// SPDX-License-Identifier: Apache-2.0
// For what is large and lives until the program ends: the system takes all memory back at once, where freeing it piece
// by piece keeps a user waiting with nothing left to wait for.
#pragma once

#include <memory>
#include <vector>

namespace braid {

template <class T>
void keepUntilExit(std::unique_ptr<T> object) {
  // Neither the list nor what it holds is destroyed, and both stay reachable: no leak.
  static std::vector<T*>& kept = *new std::vector<T*>();
  kept.push_back(object.release());
}

}  // namespace braid
