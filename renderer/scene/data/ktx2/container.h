// SPDX-License-Identifier: Apache-2.0
// What a KTX2 file says about its picture, and where it lies (KTX File Format Specification 2.0).
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/data/ktx2/bytes.h"

namespace braid::ktx2 {

enum class Supercompression : uint32_t { None = 0, BasisLz = 1, Zstandard = 2, Zlib = 3 };

// Khronos Data Format 1.4, colour models.
enum class ColourModel : uint8_t { Unspecified = 0, Rgbsda = 1, Etc1s = 163, Uastc = 166 };

struct Container {
  uint32_t vkFormat = 0;  // 0: the colour model says all
  size_t width = 0, height = 0;
  bool isSeveral = false;   // layers, faces, slices or frames of which the first is meant
  uint64_t imageCount = 1;  // of all levels
  Supercompression scheme = Supercompression::None;

  ColourModel model = ColourModel::Unspecified;
  bool srgb = false, premultiplied = false;
  std::vector<uint8_t> channels;  // of the samples, as the colour model numbers them

  bool flipsX = false, flipsY = false;  // the first texel lies right, or at the bottom
  std::string swizzle;                  // four of "rgba01", or empty

  Bytes globalData, level;  // the level of the largest images, as it lies in the file
};

bool isKtx2(Bytes data);

// Reads and checks all but pixels. Throws Error(BadInput): the header is broken, or the texture has a volume. Key/value
// data that cannot be read are passed over.
Container readContainer(Bytes file);

// The first `bytes` bytes of what a level holds, by libzstd or zlib; what follows them is not unpacked. Refuses data
// that hold less. Nothing is allocated beyond that and the window of the compression, at most 128 MiB.
std::vector<uint8_t> inflate(Supercompression scheme, Bytes level, size_t bytes);

}  // namespace braid::ktx2
