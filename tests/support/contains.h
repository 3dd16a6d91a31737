// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace braid::test {

// Whether the text has the part in it.
inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace braid::test
