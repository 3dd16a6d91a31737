// SPDX-License-Identifier: Apache-2.0
// How uncertain the pixels are that uncorrelated weighting pairs, and what becomes of fireflies, which its
// windows are too small for.
#pragma once

#include <optional>

#include "renderer/film/estimates.h"

namespace braid {

// The uncertainty of every pixel from the mean of an image and the variance of that: the variance or usualVariance()
// around it, whichever is larger, for a pixel may be without any by chance; and the latter alone where the mean is
// below 1.7 times its deviation, as that of one or two rare strong samples is, unless three of the eight neighbours
// have a sixteenth of its variance or more: rare samples seldom meet, those of a lamp's mirror image do.
Rgb<float> noiseLevels(const Rgb<float>& mean, const Rgb<float>& variance);

// The sum of those of two images, each of which counts as 0 where it has no variance: what the pixels of their
// difference are uncertain by. The independent image alone knows nothing of a glint that only the correlated one has
// met.
Rgb<float> differenceNoiseLevels(const Estimate& y, const Estimate& z);

// An image without its fireflies, and what they come to in every pixel.
struct SharedOut {
  Estimate image;            // mean, halves, quarters and variance
  Rgb<float> mean, half[2];  // to be added to what is made of them
};

// Takes the fireflies out of an image; nothing if it has none. In every channel these are the pixels whose variance is
// more than 100 times that around and does not count above, and of whose light `other`, of other samples, knows less
// than a tenth. They become those of `other`, as certain as their surroundings, and what they had more is shared out
// evenly among the 63x63 pixels about them, clipped at the borders: no light is lost.
//
// Such a sample is one of a caustic, which might have come anywhere, or of a lamp's small mirror image, and nothing
// shows which. A 3969th of it does little harm in either case (combiners/EXPERIMENTS.md, Sharing out fireflies).
std::optional<SharedOut> takeFirefliesOut(const Estimate& image, const Rgb<float>& other);

}  // namespace braid
