// SPDX-License-Identifier: Apache-2.0
// KTX2 textures as pixels: ETC1S, UASTC and plain texels.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/scene/data/ktx2/container.h"

namespace braid::ktx2 {

// The largest level of the first image, the first row at the top of the picture, alpha not multiplied into the colours.
// One of bytes and floats is filled.
struct Picture {
  int width = 0, height = 0;
  int channels = 0;  // 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA
  std::vector<uint8_t> bytes;
  std::vector<float> floats;
  bool isInteger = false;   // floats are integers of 16 bits, scaled to [0,1]
  bool srgb = false;        // as the file has it; nothing is converted
  bool isSeveral = false;   // there are more layers, faces or frames, which were left out
  bool isRedGreen = false;  // two channels were stored; blue is 0
};

// Throws Error(BadInput) with a one-line reason: broken, of a format that is not read, more than 2^28 pixels, or more
// than 2^24 in a file that is too short for them.
Picture decode(Bytes file);

}  // namespace braid::ktx2
