// SPDX-License-Identifier: Apache-2.0
// The combination of an independent and a correlated image with weights that depend on the input and yet are nearly
// uncorrelated with it (combiners/README.md, Uncorrelated weighting):
//   out_c = y_c + Σ k_i [(z_c - z_i) - (y_c - y_i)],   k_i = exp(-gamma n (D1 - D2)²) / 224   (Eqs. 5 and 8),
// over the other 224 pixels of a 15x15 window that is mirrored at the borders. With h = z1 - z2 and g = z - y it is
// out_c = y_c + Σ k(h_c - h_i) (g_c - g_i): one plane decides the weights and one is averaged.
//
// Pairs of pixels of which one is much more uncertain (uncorrelated_noise.h) are left out, k_i = 0: a 224th of its
// error may be many times the other's own. Left out for both pixels, they take no light away (combiners/EXPERIMENTS.md,
// Pairs of uncertain pixels).
#pragma once

#include <array>
#include <span>

#include "renderer/film/estimates.h"

namespace braid {

// The candidates for gamma of the paper, ascending.
inline constexpr std::array<float, 10> kUncorrelatedGammas = {0.01f, 0.025f, 0.05f, 0.1f, 0.2f,
                                                              0.5f,  1.0f,   1.5f,  2.0f, 2.5f};

// One application of the filter: images of one size. `samples` is the number n of samples in each of `first` and
// `second`, the averages of the correlated image that make the weights.
struct UncorrelatedInputs {
  const Rgb<float>*independent = nullptr, *correlated = nullptr;  // y and z
  const Rgb<float>*first = nullptr, *second = nullptr;            // of z
  double samples = 1;
  // differenceNoiseLevels() of y and z, or null; and the most that one pixel of a pair may have, in units of the
  // other's.
  const Rgb<float>* noise = nullptr;
  double mostNoise = 0;
};

// The combination for one gamma >= 0. With gamma 0 all k_i are 1/224 and the centre keeps nothing.
Rgb<float> uncorrelatedFiltered(const UncorrelatedInputs& in, double gamma);

// The combination with k_i = 1/225 for all pixels, the centre included: the baseline without any bias.
Rgb<float> uniformlyFiltered(const Rgb<float>& independent, const Rgb<float>& correlated);

// How noisy the result is for each candidate: the mean over the pixels of every `rowStep`th row and the channels of
//   (out_A - out_B)² / (ybar² + 0.01),
// where the groups A and B have no samples in common and ybar is the mean of `guide` over the window.
std::array<double, 10> uncorrelatedScores(const UncorrelatedInputs (&groups)[2], const Rgb<float>& guide, int rowStep);

// The candidate of the lowest score that is finite; the smallest one if none is, or if all are equal.
double bestGamma(const std::array<double, 10>& scores);

}  // namespace braid
