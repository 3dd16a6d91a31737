// SPDX-License-Identifier: Apache-2.0
// AVIF images by libavif: OpenImageIO reads them from files only, and Debian's has no bound for what they claim.
#pragma once

#include <memory>
#include <string>

#include "renderer/images/image_codecs.h"

namespace braid {

// Whether the bytes begin as those of an AVIF file do: a box "ftyp" with the brand "avif" or "avis".
bool isAvif(const uint8_t* data, size_t bytes);

// An image in memory, which must outlive the reader: RGB or RGBA with unassociated alpha, 8 bits or LargerInteger,
// turned and mirrored as the file says. Of a sequence the first picture. Null: `error` says why. Nothing is allocated
// for pixels before decode(), which readImage() asks for.
std::unique_ptr<ImageReader> openAvif(const uint8_t* data, size_t bytes, std::string& error);

}  // namespace braid
