// SPDX-License-Identifier: Apache-2.0
// The limit of memory that a run is held to.
#pragma once

#include <cstdint>
#include <string>

namespace braid {

// Bytes from "4G", "512M" or "1.5GiB" (all powers of 1024). Throws Error(Usage), also for less than 192 MiB.
uint64_t parseBytes(const std::string& text);

// Holds the memory of this process to so many bytes: what asks for more gets std::bad_alloc.
void limitMemory(uint64_t bytes);

// The limit that this process is under, by limitMemory() or from outside (ulimit -d).
uint64_t memoryLimit();

// "1018 MiB", with a digit behind the point below 100.
std::string mebibytes(uint64_t bytes);

}  // namespace braid
