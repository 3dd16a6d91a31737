// SPDX-License-Identifier: Apache-2.0
// The patch-Welch filter (pw_filter.h) with a wider threshold: smoother, for many samples and for ensembles. It shares
// no pass with pw: most of the time goes into the weighted sums, which every threshold needs anew.
#include "combiners/denoise/pw/pw_method.h"
#include "combiners/pipeline/registry.h"

namespace braid {

std::unique_ptr<Method> make_pw_wide() {
  return patchWelchMethod("pw-wide", "Patch-Welch filter with a wider threshold: smoother, for many samples",
                          kPatchWelchWideThreshold);
}

}  // namespace braid
