// SPDX-License-Identifier: Apache-2.0
// The patch-Welch filter (pw_filter.h) with the threshold for few samples.
#include "combiners/denoise/pw/pw_method.h"
#include "combiners/pipeline/registry.h"

namespace braid {

std::unique_ptr<Method> make_pw() {
  return patchWelchMethod("pw", "Patch-Welch filter: averages neighbours that differ by noise only",
                          kPatchWelchThreshold);
}

}  // namespace braid
