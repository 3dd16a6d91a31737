// SPDX-License-Identifier: Apache-2.0
// Which pixels this source makes of a scene, its options and a seed. States of another revision are not resumed or
// merged, and nothing is measured against references of another revision.
#pragma once

namespace braid {

// Raise it by one with every change after which an integrator or `auto` makes other pixels, be it another sample or
// another expectation. tests/integrators/test_rendering_revision.cpp sees such changes, and says how to record the new
// pixels.
inline constexpr int kRenderingRevision = 15;

}  // namespace braid
