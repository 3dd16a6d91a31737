// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <OpenImageIO/imageio.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/film/exr.h"
#include "renderer/film/output_file.h"
#include "renderer/film/srgb.h"

namespace braid {

void writePng(const std::string& path, const Rgb<float>& image, float exposureStops) {
  BRAID_ASSERT(!image.empty());
  const auto width = static_cast<size_t>(image.width());
  const float scale = std::exp2(exposureStops);
  std::vector<uint8_t> bytes(3 * image.size());
  parallelRows(image.height(), [&](int y) {
    const size_t begin = static_cast<size_t>(y) * width;
    for (size_t i = begin; i < begin + width; ++i)
      for (size_t c = 0; c < 3; ++c) {
        // max before min: NaN becomes black.
        const float v = std::min(std::max(0.0f, scale * image[c][i]), 1.0f);
        bytes[3 * i + c] = static_cast<uint8_t>(encodeSrgb(v) * 255 + 0.5f);
      }
  });

  OIIO::ImageSpec spec(image.width(), image.height(), 3, OIIO::TypeDesc::UINT8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  spec.attribute("png:compressionLevel", 4);  // half the time of the usual 6, for a hundredth more bytes
  OutputFile file(path, ".png");
  {
    const auto out = OIIO::ImageOutput::create("png");
    if (!out) file.fail(OIIO::geterror());
    if (!out->set_ioproxy(&file)) file.fail("this OpenImageIO cannot write PNG through a stream");
    if (!out->open(file.temporaryPath(), spec)) file.fail(out->geterror());
    if (!out->write_image(OIIO::TypeDesc::UINT8, bytes.data())) file.fail(out->geterror());
    if (!out->close()) file.fail(out->geterror());
  }
  file.finish();
}

}  // namespace braid
