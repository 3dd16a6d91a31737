// SPDX-License-Identifier: Apache-2.0
// Whether images belong together, by what the headers of their files say: what a file does not say is not held against
// it.
#pragma once

#include "renderer/film/files/exr.h"

namespace braid {

// What tells images apart, without the pixels.
ImageFile headOf(const ImageFile& file);

// The attributes by which the next reader can tell, for files that are made of this one.
std::vector<Attribute> viewAttributes(const ImageFile& file);

// Throws Error(BadInput) naming both files where sizes differ, or the scenes, the cameras, or the parts of the frame of
// one renderer's files.
void requireSameView(const ImageFile& first, const ImageFile& other);

// Throws Error(BadInput) where two images that have to be independent are of one seed of one scene.
void requireOtherSeed(const ImageFile& first, const ImageFile& other);

}  // namespace braid
