// SPDX-License-Identifier: Apache-2.0
// Reads the files that braid's own networks are kept in, as tools/train writes them.
//
// Little-endian: the eight letters BRAIDNET, the version 1 and the number of bytes of the description, four bytes each;
// the description, JSON; then the values, 16-bit floats: weights, then bias, of each convolution, in the order of the
// layers. The description has `inputs`, the number of channels; `layers`, each with `name`, `kind` (convolution, pool,
// upsample or concatenate), `inputs`, the names of what it reads, and of convolutions `outputs`, `kernel` and `relu`;
// `constants`, lists of numbers by name; and `training`, how the weights were found.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "combiners/learned/network.h"

namespace braid {

struct NetworkFile {
  Network network;
  std::map<std::string, std::vector<float>> constants;
  std::string training;  // JSON
};

// Throw Error(BadInput) naming the file and what is wrong. All values are finite; they take no more memory than four
// times the file.
NetworkFile readNetworkFile(const std::string& path);
NetworkFile parseNetworkFile(std::span<const uint8_t> file, const std::string& path);

}  // namespace braid
