// SPDX-License-Identifier: Apache-2.0
// The three filters that RDFC chooses from at every pixel, with their risk.
//   First:  colour by patches of 3 x 3 pixels, and features: keeps details, leaves noise.
//   Second: colour by patches of 7 x 7 pixels, and features: robust against noise.
//   Third:  features alone, with a finer threshold: for what the colour is too noisy to show.
// All have windows of 21 x 21 pixels. The weight of a pair is the smaller one of colour and features.
#pragma once

#include <array>
#include <atomic>
#include <vector>

#include "combiners/denoise/rdfc/rdfc_planes.h"

namespace braid {

inline constexpr size_t kRdfcCandidates = 3;

// The image to be filtered. Its mean is what pixels are compared by; all images are filtered with the same weights.
struct RdfcColour {
  RdfcGuide guide;                                   // three channels: mean and variance
  std::vector<std::array<MirroredPlane, 3>> images;  // the halves, if there are any; or the mean
  std::vector<float> shares;                         // the mean is the sum of shares[i] images[i]
};

struct RdfcCandidate {
  std::vector<Rgb<float>> images;  // filtered, as in RdfcColour
  Plane<float> risk;               // estimated squared error of the mean, averaged over channels; may be negative
  Plane<float> derivative;         // of the filtered by the noisy value of a pixel, mean of the channels, in [0, 1]
};

// The candidates in the above order; without features the first two. Stein's unbiased risk estimate of a channel is
//   (F - u)² + 2 V F' - V.
// F' is the difference quotient for a centre that is 1 % larger, which only the middle of the patches sees. Where it
// leaves [0, 1] in a channel, and for the third, F' is the pixel's own share of the weights.
std::vector<RdfcCandidate> rdfcCandidates(const RdfcColour& colour, const std::vector<RdfcGuide>& features,
                                          const std::atomic<bool>* cancel = nullptr);

}  // namespace braid
