// SPDX-License-Identifier: Apache-2.0
#include "tools/prepare/open_modules.h"

#include <chrono>
#include <string>

#include "combiners/learned/convolution.h"
#include "combiners/pipeline/registry.h"
#include "renderer/core/parallel.h"
#include "renderer/images/image_codecs.h"

namespace braid {

OpeningModules::OpeningModules() {
  startThreads();
  makeMethods();
  std::string ignored;  // told by the method that needs it
  openConvolutions(ignored);
  images_ = std::async(std::launch::async, [] { imageCodecs(); });
}

void OpeningModules::checkImages() {
  if (images_.valid() && images_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) images_.get();
}

}  // namespace braid
