// SPDX-License-Identifier: Apache-2.0
// Counts what the test program takes from the heap by operator new, and for image planes
// (tests/support/counted_memory.cpp).
#pragma once

#include <cstdint>

namespace braid::test {

int64_t heapBytes();
// The most since resetHeapPeak().
int64_t heapPeak();
void resetHeapPeak();

}  // namespace braid::test
