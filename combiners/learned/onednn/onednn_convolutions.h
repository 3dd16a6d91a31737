// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "combiners/learned/convolution.h"

namespace braid {

const ConvolutionLibrary& oneDnnConvolutions();

}  // namespace braid
