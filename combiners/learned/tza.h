// SPDX-License-Identifier: Apache-2.0
// Reads the files that Open Image Denoise publishes the weights of its networks in: TZA, version 2.
//
// Little-endian: the magic number 0x41D7, two bytes of version, eight bytes that say where the table begins. There, the
// number of tensors in four bytes, then of each: the length of its name in two bytes and the name, the number of
// dimensions in a byte, each dimension in four, a letter for each (o, i, h, w or x), a letter for the type (f: 32-bit
// floats, h: 16-bit), and in eight bytes where its values begin.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace braid {

struct WeightTensor {
  std::vector<int> sizes;  // [output][input][row][column], or [output]
  std::vector<float> values;
};
using WeightTensors = std::map<std::string, WeightTensor>;

// Throw Error(BadInput) naming the file and the tensor. All values are finite; they take no more memory than four times
// the file.
WeightTensors readTza(const std::string& path);
WeightTensors parseTza(std::span<const uint8_t> file, const std::string& path);

}  // namespace braid
