// SPDX-License-Identifier: Apache-2.0
// Estimates from image files: braid's own, with everything that combiners read, and those of other renderers.
#pragma once

#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/files/exr.h"

namespace braid {

// What a file of braid must say about its estimates besides planes: "braid/<name>/unbiased", "…/correlation",
// "…/passes" and "braid/seed". `timing`: also "…/seconds".
std::vector<Attribute> estimateAttributes(const Estimates& estimates, bool timing = true);

// The resolution that was rendered, such as "960x540", where the pixels of a file are copies of fewer
// (coarse_render.h).
inline constexpr const char* kRenderedSizeAttribute = "braid/renderedSize";

// What a file of another renderer is read as, for files that hold an image before and after denoising.
enum class ImageRole { Noisy, Denoised };

struct ReadOptions {
  std::string foreignName = "image";  // of the estimate in a file of another renderer
  ImageRole role = ImageRole::Noisy;
  uint64_t samplesPerPixel = 0;               // where the file does not say; 0: unknown
  std::vector<std::string>* notes = nullptr;  // gets one line for everything that is missing or assumed
  std::string layer{};                        // of a file of another renderer, see readForeign()
  // Works out what the first estimate of another renderer lacks of variance and halves
  // (combiners/pipeline/spatial_variance.h); the attributes of the estimates say so.
  bool derive = false;
  Plane<float>* alpha = nullptr;    // gets the alpha channel that goes with the image, if there is one
  ImageFile* head = nullptr;        // gets the header of the first file
  const ImageFile* like = nullptr;  // a header of the same view, or else the files are refused
};

// A file of braid: every layer <name>.mean with its halves, quarters, variances, bias and earlier variances, the
// features, and what the header says of them. Any other file becomes one estimate:
//   pbrt      R G B; Albedo, Ns or N, P; Variance (of one sample) over samplesPerPixel
//   Mitsuba   R G B or <integrator>.R G B; AOVs named like albedo (R G B), normal (X Y Z) and depth (T); the second
//             moments m2_<integrator> of the moment integrator
//   Cycles    <Layer>.Noisy Image or <Layer>.Combined; Denoising Albedo, Denoising Normal, Depth
// The last part of layer names is matched without regard to case. Features without halves and variances count as free
// of noise. Throws Error(BadInput) for files without colours, and
// for those whose pixels are copies of each other.
Estimates readEstimates(const ImageFile& file, const ReadOptions& options = {});

// Completes the first estimate: its variance from its halves, else from the differences of neighbouring pixels; halves
// from the image and its variance. The attributes say so, and `notes` gets a line that begins with `file` for each.
void deriveStatistics(Estimates& all, const std::string& file, std::vector<std::string>* notes);

// Estimates by an option such as --unbiased: FILE; or HALFA,HALFB, whose mean is the image; or IMAGE,HALFA,HALFB. FILE
// may be FILE:NAME for one of the estimates in a file of braid, which then is the first, or for a layer of another
// renderer's. Variances that are missing are taken from the halves, (A - B)²/4. Invalid pixels of other renderers are
// filled (combiners/pipeline/invalid_pixels.h). Throws Error(BadInput), also for halves that are the same pixels or of
// the same seed, and for files of different views.
Estimates readEstimatesOption(const std::string& text, const ReadOptions& options);

}  // namespace braid
