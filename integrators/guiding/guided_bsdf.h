// SPDX-License-Identifier: Apache-2.0
// A surface whose directions are sampled by its BSDF and by what was learned of the light there, in one sample:
//
//   pdf(wi) = (1 - c) pdf_bsdf(wi) + c (1 - d) pdf_guide(wi),
//
// c the guide's share in the region, d the probability of delta lobes, which keep theirs. Everything that weighs
// sampled lights against sampled directions reads this density.
#pragma once

#include "integrators/guiding/guide.h"
#include "renderer/core/sampler.h"
#include "renderer/transport/bsdf/bsdf.h"
#include "renderer/transport/hit.h"

namespace braid {

struct GuidedSample : BsdfSample {  // with the density of the mixture, and the weight that belongs to it
  float bsdfPdfW = 0;               // of the BSDF alone; lobes that are not delta
  float guidePdfW = 0;              // of the guide, times the probability of such lobes; 0 where there is none
};

class GuidedBsdf {
 public:
  // Without a guide: the BSDF, bit by bit.
  GuidedBsdf(const Bsdf& bsdf) : bsdf_(bsdf) {}  // NOLINT: wherever a BSDF serves
  GuidedBsdf(const Bsdf& bsdf, const Guide& guide, const Hit& hit) : bsdf_(bsdf), frame_(&hit.frame) {
    class_ = guideClass(hit.ng, isNarrow(bsdf));
    region_ = guide.find(class_, hit.position);
    if (!region_) return;
    table_ = &guide.table(*region_);
    nonDelta_ = 1 - bsdf.deltaShare();
  }

  static bool isNarrow(const Bsdf& bsdf) { return bsdf.broadShare() < 0.5f; }

  const Bsdf& bsdf() const { return bsdf_; }
  bool guided() const { return region_ != nullptr; }

  // As Bsdf::evaluate(), with the density of the mixture where the BSDF is not black.
  BsdfValue evaluate(const Vec3& wi) const {
    BsdfValue value = bsdf_.evaluate(wi);
    if (region_ && !isBlack(value.f)) value.pdfW = mixed(value.pdfW, guidePdf(wi));
    return value;
  }

  // As Bsdf::sample(); `u` is the vertex's block of random numbers.
  bool sample(const SampleBlock& u, GuidedSample& out) const;

 private:
  float mixed(float bsdfPdf, float guidePdf) const { return bsdfPdf + region_->share * (guidePdf - bsdfPdf); }
  float guidePdf(const Vec3& wi) const;

  const Bsdf& bsdf_;
  const Frame* frame_ = nullptr;
  const GuideRegion* region_ = nullptr;
  const DirectionalTable* table_ = nullptr;
  int class_ = 0;
  float nonDelta_ = 1;
};

}  // namespace braid
