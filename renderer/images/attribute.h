// SPDX-License-Identifier: Apache-2.0
// Metadata in the header of an image file: a name and a value.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace braid {

struct Attribute {
  std::string name;
  enum class Kind { String, Int, Float, Matrix, Chromaticities } kind = Kind::String;
  std::string text;
  int64_t integer = 0;
  double number = 0;
  std::vector<float> values;  // Matrix: 16, row-major as OpenImageIO wants it; Chromaticities: 8
};

}  // namespace braid
