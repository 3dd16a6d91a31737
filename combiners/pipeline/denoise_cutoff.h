// SPDX-License-Identifier: Apache-2.0
// Combiners that need not denoise for ever: from some number of passes on they go on with the image that was denoised
// then, blended with ever newer samples. For that, the film keeps the noisy image of that time (Checkpoint), which
// takes the place of the newest one as the denoiser's input.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "combiners/method.h"

namespace braid {

// For all that have no stop of their own.
inline const OptionInfo kCurvesStop{
    "curves-stop", 0, "Passes after which nothing is denoised anew, rounded up to 2, 4, 8, ...; 0: never", 0, 1e12};

class StoppingMethod : public Method {
 public:
  // Its own stop, in passes of the unbiased estimate; 0: that of CombinePlanOptions.
  virtual uint64_t stop() const = 0;
  // The method with its own stop, for "name:passes".
  virtual std::unique_ptr<Method> stoppedAfter(uint64_t passes) const = 0;
};

// The passes that a user's number stands for: a whole number; none before there is a variance.
uint64_t stopPasses(double number);

}  // namespace braid
