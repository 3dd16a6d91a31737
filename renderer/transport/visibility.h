// SPDX-License-Identifier: Apache-2.0
// What of a light gets through to a point: nothing past a surface, unless that is a pane, thin, smooth and clear, which
// light crosses straight on, or covers its place in part (alpha-blended). A ray is multiplied by the exact
// transmittance of all that it crosses; since the path is straight, nothing is estimated, and lights without size are
// found behind panes, too.
//
// Paths that are walked pass panes likewise (Bsdf::straightTransmittance() is the transmission of their BSDF, taken out
// of scattering), so that all ways to sample a path agree on which surfaces are its vertices.
#pragma once

#include <array>
#include <memory>

#include "renderer/transport/context.h"
#include "renderer/transport/media.h"

namespace braid {

// A path or ray that has crossed so many panes ends.
inline constexpr int kMostPanes = 256;

// Up to kBatch rays. Scenes without panes ask Embree whether anything lies between; in the others each ray finds its
// surfaces one after the other.
class VisibilityBatch {
 public:
  explicit VisibilityBatch(const TransportContext& context);
  ~VisibilityBatch();

  // `index`: mediumIndex() of where the ray runs.
  void set(int i, const RayQuery& ray, float index) {
    rays_.set(i, ray);
    if (panes_) setIndex(i, index);
  }
  RayQuery get(int i) const { return rays_.get(i); }
  // Traces the first `count` rays and consumes them.
  void trace(int count);
  // The same, but panes hide what lies behind them, and what is covered in part lets some of the rays pass.
  void traceOpaque(int count);

  bool hidden(int i) const { return hidden_[static_cast<size_t>(i)]; }
  // Multiplies by the transmittance of what ray i crossed, where it is not hidden.
  void attenuate(int i, Spectrum& value) const {
    if (panes_) value *= transmittance(i);
    if (blends_) value *= passing_[static_cast<size_t>(i)];
  }

 private:
  struct Panes;  // of scenes that have some
  void setIndex(int i, float index);
  const Spectrum& transmittance(int i) const;

  const Scene& scene_;
  ShadowBatch rays_;
  std::array<bool, kBatch> hidden_{};
  bool blends_ = false;  // the scene has alpha-blended surfaces, and no panes
  std::array<float, kBatch> passing_{};
  std::unique_ptr<Panes> panes_;
};

}  // namespace braid
