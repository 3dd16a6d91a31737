// SPDX-License-Identifier: Apache-2.0
// KTX2 textures as images.
#pragma once

#include <memory>
#include <string>

#include "renderer/scene/data/textures/texture.h"

namespace braid {

// What the file says beside its pixels.
struct Ktx2Facts {
  bool srgb = false;        // its colours are encoded as sRGB
  bool isSeveral = false;   // of several layers, faces or frames the first was read
  bool isRedGreen = false;  // it holds two channels; blue is 0
};

bool isKtx2(const uint8_t* data, size_t bytes);

// Decodes the largest level of the first image, with unassociated alpha. Throws Error(BadInput) with a one-line reason.
std::shared_ptr<const Image> decodeKtx2(const uint8_t* data, size_t bytes, const std::string& name);
std::shared_ptr<const Image> decodeKtx2(const uint8_t* data, size_t bytes, const std::string& name, Ktx2Facts& facts);

// Normals of two channels with the third: blue = z of a vector of length 1 whose x and y are red and green. RGB of 8
// bits or floats in [0,1].
std::shared_ptr<const Image> withNormalZ(const Image& image);

}  // namespace braid
