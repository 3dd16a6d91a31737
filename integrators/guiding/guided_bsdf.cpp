// SPDX-License-Identifier: Apache-2.0
#include "integrators/guiding/guided_bsdf.h"

namespace braid {

namespace {

constexpr float kUniformSphere = 0.25f * kInvPi;

}  // namespace

float GuidedBsdf::guidePdf(const Vec3& wi) const {
  const Vec3 w = toGuideAxes(class_, frame_->toWorld(wi));
  return nonDelta_ * kUniformSphere * squareStretch(w) * table_->density(squareOfDirection(w));
}

bool GuidedBsdf::sample(const SampleBlock& block, GuidedSample& out) const {
  const float uLobe = block.u[slot::kLobe];
  const Vec2 u(block.u[slot::kBsdfU], block.u[slot::kBsdfV]);
  if (!region_ || !(block.u[slot::kExtra] < region_->share) || bsdf_.picksDelta(uLobe)) {
    if (!bsdf_.sample(uLobe, u, out)) return false;
    out.bsdfPdfW = out.pdfW;
    out.guidePdfW = 0;
    if (!region_ || out.delta) return true;
    out.guidePdfW = guidePdf(out.wi);
    out.pdfW = mixed(out.bsdfPdfW, out.guidePdfW);
    out.weight *= out.bsdfPdfW / out.pdfW;
    return true;
  }
  float density = 1;
  const Vec3 w = directionOfSquare(table_->sample(u, density));
  out.wi = frame_->toLocal(fromGuideAxes(class_, w));
  const BsdfValue value = bsdf_.evaluate(out.wi);
  if (isBlack(value.f)) return false;
  out.bsdfPdfW = value.pdfW;
  out.guidePdfW = nonDelta_ * kUniformSphere * squareStretch(w) * density;
  out.pdfW = mixed(out.bsdfPdfW, out.guidePdfW);
  if (!(out.pdfW > 0)) return false;
  out.weight = value.f / out.pdfW;
  out.delta = out.straight = false;
  out.transmitted = out.wi.z < 0;
  return true;
}

}  // namespace braid
