// SPDX-License-Identifier: Apache-2.0
// What strangers may hand to braid, as functions of bytes. Anything but a return is a finding: an exception that is no
// braid::Error, a value that is not finite where the reader promises finite ones, a crash, a sanitizer's report.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace braid::fuzz {

using Input = std::span<const uint8_t>;

// A .glb when it begins with "glTF". Anything else is JSON up to the first zero byte and the binary chunk behind it,
// put into a GLB whose lengths are right, so that mutations reach what lies behind the container. What loads is built
// and, when it is small, rendered with one sample.
void gltf(Input input);
// An encoded image: of a texture or an environment.
void texture(Input input);
// A KTX2 texture whose sides are cut to 255 texels: large flat pictures in short files are legal, and slow.
void ktx2(Input input);
// An image file given to `combine` or `compare`: EXR, by braid or others.
void image(Input input);
// A state file: header up to the first zero byte, planes behind it; the first line and the checksum are put right.
void state(Input input);
// A file of weights in TZA, and the network that they make.
void weights(Input input);

struct Target {
  const char* name;
  void (*run)(Input);
};
const std::vector<Target>& targets();

}  // namespace braid::fuzz
