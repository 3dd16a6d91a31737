// SPDX-License-Identifier: Apache-2.0
// The files that a scene is made of, found without loading it.
#pragma once

#include <string>
#include <vector>

namespace braid {

// The glTF or GLB file itself, and all that its text names as "uri", decoded and relative to its folder. What cannot be
// read names nothing: telling so is the loader's part.
std::vector<std::string> filesOfScene(const std::string& scene);

}  // namespace braid
