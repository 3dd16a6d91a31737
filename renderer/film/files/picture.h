// SPDX-License-Identifier: Apache-2.0
// Images for eyes and other programs, beside EXR: formats by the endings of file names.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/core/plane.h"
#include "renderer/film/files/tone.h"

namespace braid {

enum class ImageFormat { Exr, Png, Jpeg, Hdr, Tiff };

// The format that the ending says, in any case of letters; EXR for standard output and for devices and FIFOs without
// an ending. Throws Error(Usage) listing the endings.
ImageFormat imageFormat(const std::string& path);

// Whether the format is for eyes: 8 bits, tone-mapped.
bool isForDisplay(ImageFormat format);

// 8 bits a channel of three, or of four with `alpha`, as toDisplay() has them. The image is premultiplied by alpha;
// what comes out is not, as files of 8 bits have it. NaN is black.
std::vector<uint8_t> toneMapped(const Rgb<float>& image, const Plane<float>* alpha, const Tone& tone);

// A file of `format`, any but EXR. PNG and JPEG are tone-mapped; Radiance HDR and TIFF hold linear floats, and no
// exposure. PNG and TIFF have the alpha channel, not premultiplied; in the others the background is black. Throws
// Error(OutputFailed).
void writePicture(const std::string& path, ImageFormat format, const Rgb<float>& image, const Plane<float>* alpha,
                  const Tone& tone);

}  // namespace braid
