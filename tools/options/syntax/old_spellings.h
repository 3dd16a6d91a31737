// SPDX-License-Identifier: Apache-2.0
// Options by the names that they had before: scripts of users go on working.
#pragma once

#include <string>
#include <vector>

namespace braid {

// The arguments with every old spelling of an option replaced by the present one, "--option=value" too. What follows
// "--" is no option and stays.
std::vector<std::string> presentSpellings(int argc, const char* const* argv);

}  // namespace braid
