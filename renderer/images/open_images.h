// SPDX-License-Identifier: Apache-2.0
// Opens the image codecs beside other work.
#pragma once

#include <chrono>
#include <future>

#include "renderer/images/image_codecs.h"

namespace braid {

// The destructor waits: no program may end meanwhile.
class OpeningImages {
 public:
  // Throws what imageCodecs() throws as soon as that is known: what cannot be written should not be rendered.
  void check() {
    if (opened_.valid() && opened_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) opened_.get();
  }

 private:
  std::future<void> opened_ = std::async(std::launch::async, [] { imageCodecs(); });
};

}  // namespace braid
