// SPDX-License-Identifier: Apache-2.0
// What `pt` finds out before its first pass: the guide of its paths, how many lights a path samples at its first
// surface that is no mirror, and in how many directions it goes on from there. More of them pay where they are most of
// the noise and cost little beside the rest of the path (integrators/README.md, Light samples, Path splits). A pure
// function of what the guide is one of.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "integrators/guide_preparation.h"
#include "integrators/path_kernel.h"
#include "renderer/session/preparation_ref.h"

namespace braid {

// Of a mean over pixels, with one light sample (or direction): the share of the relative variance that it makes, and of
// the cost that it takes, both in [0, 1].
struct SampleShares {
  double variance = 0, cost = 0;
};

// How many times less variance x cost `count` samples have than one.
double sampleGain(const SampleShares& shares, int count);
// The number of samples with the least variance x cost; 1 where others gain too little to be believed.
int lightSamplesThatPay(const SampleShares& shares);
// The same of directions, of which there are powers of two. `without` holds the shares with one part of the pixels left
// out after the other, which tell how far the gain is to be believed.
int pathSplitsThatPay(const SampleShares& shares, std::span<const SampleShares> without);
// The standard error of the gain, by these parts (jackknife).
double sampleGainError(std::span<const SampleShares> without, int count);

// Whether the number of light samples, or of directions, is measured.
Applies lightSamplesMeasured(const Plan& plan);
Applies pathSplitsMeasured(const Plan& plan);

class PathPreparation : public Preparation {
 public:
  PathPreparation(const TransportContext& context, const Plan& plan);

  PathAids aids() const { return {guide_ ? guide_->guide() : nullptr, lightSamples_, pathSplits_}; }
  std::vector<PlanLine> decisions() const override { return decisions_; }

  using Ref = PreparationRef<PathPreparation>;

 private:
  class Trial;
  void chooseLightSamples(const Trial& trial);
  void choosePathSplits(const Trial& trial);

  std::optional<GuidePreparation> guide_;
  int lightSamples_ = 1, pathSplits_ = 1;
  std::vector<PlanLine> decisions_;
};

}  // namespace braid
