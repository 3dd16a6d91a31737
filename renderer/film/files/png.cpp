// SPDX-License-Identifier: Apache-2.0
#include "renderer/film/files/exr.h"
#include "renderer/film/files/picture.h"

namespace braid {

void writePng(const std::string& path, const Rgb<float>& image, float exposureStops) {
  writePicture(path, ImageFormat::Png, image, nullptr, {ToneCurve::None, exposureStops});
}

}  // namespace braid
