// SPDX-License-Identifier: Apache-2.0
// The combination of an independent and a correlated image with weights that depend on the input and yet are nearly
// uncorrelated with it ("Input-Dependent Uncorrelated Weighting for Monte Carlo Denoising", 2023):
//   out_c = y_c + Σ k_i [(z_c - z_i) - (y_c - y_i)],   k_i = exp(-gamma n (D1 - D2)²) / 224   (Eqs. 5 and 8),
// over the other 224 pixels of a 15x15 window that is mirrored at the borders, for every colour channel. D1 and D2 are
// the differences of pixels c and i in two averages of n samples each of the correlated image z: where they agree, z
// knows that difference well. k does not change with a common offset of an average or the sign of a difference.
//
// With h = z1 - z2 and g = z - y the formula is out_c = y_c + Σ k(h_c - h_i) (g_c - g_i): one plane decides the weights
// and one is averaged.
//
// Pairs of pixels of which one is much more uncertain than the other (a lamp's mirror image beside the dark) are left
// out, k_i = 0: a 224th of the one's error may be many times the other's own. Left out for both, they change no mean of
// the image: left out for one, up to 8 % of the light went where rare strong samples make the variance (glass of water
// at 16 samples). Few neighbours keep glossy reflections of lamps from harm, many find caustics, whose pixels are as
// uncertain: with pairs of up to 224, 100 and 30 times the variance plates at 16 samples have 1.33, 0.97 and 0.60 times
// the error of the better input, glass of water 0.04, 0.16 and 0.18 times, and up to 20 times more in single runs.
// What is uncertain, and what becomes of single strong samples, is for uncorrelated_noise.h to say.
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
