// SPDX-License-Identifier: Apache-2.0
// Opens the image codecs beside other work.
#pragma once

#include <future>

#include "renderer/images/image_codecs.h"

namespace braid {

// get() waits for it and throws what imageCodecs() throws; so does the destructor wait, as no program may end
// meanwhile.
inline std::future<void> openImages() {
  return std::async(std::launch::async, [] { imageCodecs(); });
}

}  // namespace braid
