// SPDX-License-Identifier: Apache-2.0
// Images and features in the EXR files of pbrt, Mitsuba 3 and Cycles, by the channel names that they give.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/files/exr.h"

namespace braid {

struct ForeignImage {
  Estimate estimate;  // mean; variance of the mean and passes where the file tells them
  std::optional<Features> features;
  Plane<float> alpha;              // of the same layer; empty: there is none
  std::vector<std::string> notes;  // what is read, missing or assumed, a line each
};

// `denoised`: the image after denoising, where a file holds both. `samplesPerPixel`: where the file does not say; 0:
// unknown. `layer`: a view layer, whose passes have names such as <layer>.Combined, or the layer of the colours itself;
// empty: the first. Throws Error(BadInput) for files without colours or without that layer.
ForeignImage readForeign(const ImageFile& file, bool denoised, uint64_t samplesPerPixel, const std::string& layer = "");

// Fills what is missing: halves equal to the mean and no variance, that is free of noise, and zero planes for features
// that there are not. False when there is neither albedo nor normal.
bool completeFeatures(Features& features, int width, int height);

}  // namespace braid
