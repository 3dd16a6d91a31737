// SPDX-License-Identifier: Apache-2.0
// Learns, once per render, where light comes from: fixed rounds of paths over a coarse grid of the full frame's pixels,
// each guided by what the ones before found (integrators/README.md, Path guiding). What it makes is a pure function of
// scene, camera, size of the frame, longest path, lights' strategy and seed: not of the window or the number of passes,
// so that crops, resumed renders and the shares of a farm are guided alike.
#pragma once

#include <optional>
#include <vector>

#include "integrators/guiding/guide.h"
#include "renderer/session/preparation_ref.h"

namespace braid {

// Whether a guide is learned at all.
Applies guidingApplies(const Plan& plan);
// At most, while it is learned.
uint64_t guidingBytes(const Plan& plan);

class GuidePreparation : public Preparation {
 public:
  GuidePreparation(const TransportContext& context, const Plan& plan);

  // Null where paths are not guided, as it would not pay.
  const Guide* guide() const { return guide_ ? &*guide_ : nullptr; }
  std::vector<PlanLine> decisions() const override { return decisions_; }

  using Ref = PreparationRef<GuidePreparation>;

 private:
  std::optional<Guide> guide_;
  std::vector<PlanLine> decisions_;
};

}  // namespace braid
