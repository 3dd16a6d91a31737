// SPDX-License-Identifier: Apache-2.0
#include "combiners/shrinkage/neural/learned_noise.h"

#include <fmt/format.h>

#include "combiners/learned/network_place.h"
#include "combiners/learned/planes/window_cells.h"
#include "renderer/core/error.h"

namespace braid {

ShrinkageNetwork openShrinkageNetwork(const std::string& method, int planes, int kernels, int radius) {
  std::string reason;
  const ConvolutionLibrary* library = openConvolutions(reason);
  if (!library) throw Error(ExitCode::Usage, reason);
  const std::string file = findNetwork(method);
  auto network = std::make_unique<PlaneNetwork>(file, planes, *library);
  const int outputs = network->outputs();
  const int across = (outputs - 1) % kernels == 0 ? WindowCells::across((outputs - 1) / kernels, radius) : 0;
  if (across == 0)
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {} numbers a pixel are not {} square windows of at most {} pixels across and one more",
                            file, outputs, kernels, 2 * radius + 1));
  return {std::move(network), across};
}

}  // namespace braid
