// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "combiners/denoise/oidn/oidn_library.h"
#include "combiners/denoise/oidn/oidn_networks.h"
#include "combiners/method.h"

namespace braid {

// The denoiser by these functions of the library, or by these weights; with neither it cannot run for `reason`.
std::unique_ptr<Method> makeOidn(const OidnApi* api, const std::string& reason, const OidnWeights& weights = {});

}  // namespace braid
