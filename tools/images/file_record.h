// SPDX-License-Identifier: Apache-2.0
// What a file that is no scene holds: an image, or the state of a render.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

namespace braid {

// Of an image: "schema", "file", "kind" ("image"), "size" and "window" in pixels, "layers" with their channels, and
// everything that its header says under "attributes". Of a state, "kind" is "state": "passes" by estimate, as [begin,
// end), "seed" and "options" instead of layers. Nothing for other files. Throws Error(BadInput) for one that is
// damaged.
std::optional<nlohmann::json> fileRecord(const std::string& path);

}  // namespace braid
