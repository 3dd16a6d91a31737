// SPDX-License-Identifier: Apache-2.0
// Attributes of image headers from names and values.
#pragma once

#include <cstdint>
#include <string>

#include "renderer/images/attribute.h"

namespace braid {

inline Attribute textAttribute(const std::string& name, const std::string& text) {
  return {name, Attribute::Kind::String, text, 0, 0, {}};
}
inline Attribute wholeAttribute(const std::string& name, int64_t value) {
  return {name, Attribute::Kind::Int, "", value, 0, {}};
}
inline Attribute numberAttribute(const std::string& name, double value) {
  return {name, Attribute::Kind::Float, "", 0, value, {}};
}

}  // namespace braid
