// SPDX-License-Identifier: Apache-2.0
// Opens what a run opens of modules: the short ones, then the image codecs beside other work. A module waits for any
// that is being opened, and the codecs take a third of a second with all that they depend on.
#pragma once

#include <future>

namespace braid {

class OpeningModules {
 public:
  OpeningModules();

  // Throws what imageCodecs() throws as soon as that is known: what cannot be written should not be rendered.
  void checkImages();

 private:
  std::future<void> images_;  // its destructor waits: no program may end meanwhile
};

}  // namespace braid
