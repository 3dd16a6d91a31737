// SPDX-License-Identifier: Apache-2.0
// What files of weights have in common.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace braid {

// The bytes of a file. Throws Error(BadInput) naming it where it cannot be read or holds more than `most` bytes.
std::vector<uint8_t> readWeightsFile(const std::string& path, uint64_t most);

// The 16-bit floats that the bytes hold one after the other.
std::vector<float> fromHalves(std::span<const uint8_t> bytes);

// Whether all are finite.
bool areFinite(std::span<const float> values);

}  // namespace braid
