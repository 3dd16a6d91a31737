// SPDX-License-Identifier: Apache-2.0
// What combiners, writers and callers see of a render: immutable planes of float means and variances.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "renderer/film/film.h"
#include "renderer/images/attribute.h"

namespace braid {

// What the pixels of one pass share: nothing, their random numbers, or a reconstruction from each other's gradients.
enum class Correlation { Independent, CommonRandomNumbers, Gradients };

// What is known of an estimate besides its images.
struct EstimateHead {
  std::string name;
  bool unbiased = true;
  Correlation correlation = Correlation::Independent;
  uint64_t passes = 0;
  double seconds = 0;
  uint64_t rejected = 0;
};

// Mean, halves and variance of the mean of a part of an estimate's light.
struct DirectLight {
  Rgb<float> mean, half[2], variance;
};

// One integrator's image so far.
struct Estimate : EstimateHead {
  Rgb<float> mean;
  Rgb<float> half[2];               // A, B
  std::vector<Rgb<float>> quarter;  // four, or none
  Rgb<float> variance;              // of the mean; empty when not known
  // Of the pixels, where they differ in their numbers (SamplePlacement): `passes` on average; else empty. The mean is
  // that of the two halves then, whatever their numbers.
  Plane<float> samples;
  // Of integrators that estimate their bias: the mean estimate, those of the halves, and the variance of the mean; else
  // empty.
  Rgb<float> bias, biasHalf[2], biasVariance;
  // Of integrators that tell two parts of the light apart, where these are kept; else empty. Direct light comes
  // straight from lights to the first non-specular vertex of the camera's path, or to the camera, there perhaps by
  // specular vertices. The rest is indirect: mean and halves are differences, only the variance is not.
  DirectLight direct;
  Rgb<float> indirectVariance;
};

// The state of an estimate at an earlier time, for methods that look at convergence.
struct Checkpoint {
  uint64_t passes = 0;
  double seconds = 0;
  Rgb<float> variance;
  // The image of then, where denoising is to stop (StoppingMethod); else empty.
  Rgb<float> mean{}, half[2]{};
};

// Of which image the estimates are.
struct EstimatesHead {
  int width = 0, height = 0;  // of the planes: the window
  PixelWindow window;         // the part of the full frame that the planes hold
  int fullWidth = 0, fullHeight = 0;
  uint64_t seed = 0;
};

struct Estimates : EstimatesHead {
  std::vector<Estimate> estimates;
  std::optional<Features> features;
  std::vector<Attribute> attributes;  // of the EXR header, in this order
  // By name of the estimate: its earlier states at rounds 1, 2, 4, …, oldest first; none unless asked for.
  std::map<std::string, std::vector<Checkpoint>> history;
  // The image that all of them estimate, where it is known: for methods that show how good a choice could be.
  Rgb<float> reference;

  const Estimate* find(const std::string& name) const {
    for (const Estimate& e : estimates)
      if (e.name == name) return &e;
    return nullptr;
  }
};

}  // namespace braid
