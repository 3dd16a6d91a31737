// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace braid {

// Filters work on radiance over albedo, of which they take at least this: on black things the division would make of
// noise what no window can average away.
inline constexpr float kLeastAlbedo = 0.03f;

}  // namespace braid
