// SPDX-License-Identifier: Apache-2.0
// What `pt` finds out before its first pass: the guide of its paths, and how many lights a path samples at its first
// surface that is no mirror. More of them pay where light samples there are most of the noise and cost little beside
// the rest of the path (integrators/README.md, Light samples). A pure function of what the guide is one of.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "integrators/guide_preparation.h"
#include "integrators/path_kernel.h"
#include "renderer/session/preparation_ref.h"

namespace braid {

// Of a mean over pixels, with one light sample: the share of the relative variance that light samples make, and of the
// cost that one takes, both in [0, 1].
struct LightSampleShares {
  double variance = 0, cost = 0;
};

// How many times less variance x cost `count` samples have than one.
double lightSampleGain(const LightSampleShares& shares, int count);
// The number of samples with the least variance x cost; 1 where others gain too little to be believed.
int lightSamplesThatPay(const LightSampleShares& shares);

// Whether the number of light samples is measured.
Applies lightSamplesMeasured(const Plan& plan);

class PathPreparation : public Preparation {
 public:
  PathPreparation(const TransportContext& context, const Plan& plan);

  PathAids aids() const { return {guide_ ? guide_->guide() : nullptr, lightSamples_}; }
  std::vector<PlanLine> decisions() const override { return decisions_; }

  using Ref = PreparationRef<PathPreparation>;

 private:
  void measureLightSamples(const TransportContext& context, const Plan& plan);

  std::optional<GuidePreparation> guide_;
  int lightSamples_ = 1;
  std::vector<PlanLine> decisions_;
};

}  // namespace braid
