// SPDX-License-Identifier: Apache-2.0
// Weights of an ensemble of denoised images that minimise its estimated squared error ("Ensemble Denoising for Monte
// Carlo Renderings", 3.2 and 4.1).
#pragma once

#include <vector>

#include "renderer/film/estimates.h"

namespace braid {

// A weight for every base, pixel, and channel or all channels together; they sum to 1 over the bases.
struct WeightMaps {
  size_t bases = 0, channels = 1;
  std::vector<Plane<float>> planes;  // bases times channels
  Plane<float>& of(size_t base, size_t c) { return planes[base * channels + (channels == 1 ? 0 : c)]; }
  const Plane<float>& of(size_t base, size_t c) const { return planes[base * channels + (channels == 1 ? 0 : c)]; }
};

// Maps that are all 1 / bases.
WeightMaps uniformWeights(size_t bases, size_t channels, int width, int height);

struct EnsembleChoices {
  int patchRadius = 3;  // M is summed over patches of (2 radius + 1)² pixels; 0 as in the paper
  // Blocks of stride² pixels share the weights of their first one: 1, 2, 4, …, 32. A patch is far larger than a block
  // and moves slowly.
  int stride = 1;
  bool nonNegative = true;
  bool shared = false;        // one weight for all channels, from the sum of their errors
  bool fullError = false;     // estimate the error of the mean of both halves instead of that of a half
  double improvement = 1e-9;  // see SimplexSolver
  // Square roots of the weights of pixels in the sums over patches; null: all 1.
  const Plane<float>* rootWeights = nullptr;
  // How much the noise of the unbiased image, which M holds, draws weights towards equal ones; see below. 0: not at
  // all.
  double prior = 0;
};

// Minimises wᵀMw with sum(w) = 1, where M is the sum over a patch, clipped at the borders, of
//   M_ij = ½ (e_i^A e_j^A + e_i^B e_j^B),   e_i^A = y_i^A - x^B,   e_i^B = y_i^B - x^A,
// which has the minimiser of the paper's <M> because both differ by the same constant in every entry; its expectation
// is the matrix of errors of the halves, plus that constant. `fullError` subtracts ¼ (y_i^A - y_i^B)(y_j^A - y_j^B).
// One pixel and channel gives M a rank of 2, so with three bases and more its minimiser is not even unique; a patch
// gives full rank and less noise. All images have halves.
//
// Where bases differ by less than the noise of x, M says little of which is better: of two, the best weight is known to
// a variance of n / D, with D the sum over the patch of (y_1^A - y_2^A)² + (y_1^B - y_2^B)² and n the mean variance of
// a half of x. Weights that are believed to be 1/N with a variance of s² beforehand add n / (2 s²) |w - 1/N|² to
// 2 wᵀMw. `prior` is 1 / (2 s²): 6 for weights that may be anything in [0, 1].
WeightMaps ensembleWeights(const Estimate& unbiased, const std::vector<const Estimate*>& bases,
                           const EnsembleChoices& choices);

// Σ w_i image_i. Sums in double.
Rgb<float> weightedImage(const WeightMaps& weights, const std::vector<const Rgb<float>*>& images);

// The mean and the halves with the same weights.
Estimate weightedEstimate(const WeightMaps& weights, const std::vector<const Estimate*>& bases);

// One map a base, averaged over channels.
std::vector<Plane<float>> channelMeans(const WeightMaps& weights);

}  // namespace braid
