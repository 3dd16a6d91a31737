// SPDX-License-Identifier: Apache-2.0
// What GGX surfaces lose to single scattering, given back by a factor on the lobe itself: no lobe more to sample.
//
// Metals: c(wo) c(wi), which is reciprocal, with the one function c by which a white metal returns all light,
//
//   c(wo) ∫ f(wo, wi) c(wi) |cos wi| dwi = 1,
//
// the symmetric scaling of a kernel to a doubly stochastic one (Sinkhorn & Knopp 1967). The metal's colour scales what
// exceeds 1 as the series of later bounces does, F E / (1 - F (1 - E)) with the mean Fresnel term F and the mean albedo
// E (Kulla & Conty 2017, eq. 15).
#pragma once

#include "renderer/core/vec.h"
#include "renderer/transport/bsdf/albedo_tables.h"

namespace braid {

// Tables are built by fixed quadrature, each part once, when it is first used.

// c of a direction on a metal, by its cosine; the row is that of alpha.
TableRow metalScatterRow(float alpha);
float metalScatterFactor(const TableRow& row, float cosine);
// Per channel, from the reflectance at normal incidence.
Spectrum metalScatterColour(const TableRow& row, const Spectrum& f0);

// Transmission: 1 / E of the direction on the camera's side, E being the albedo of single scattering, reflected and
// transmitted (Turquin 2019, "Practical multiple scattering compensation for microfacet models"); c would be extreme at
// low indices. Walks from lights find the same factor at the direction that they go to.

// A place in the tables of white glass: of a solid, from one side, or of a thin wall.
struct GlassPlace {
  TableRow alpha{}, index{};
  bool thin = false, inside = false;  // inside: this side has the larger index
  GlassPlace otherSide() const { return {alpha, index, thin, !thin && !inside}; }
};

// eta: index on the other side over index on this one; of a thin wall, inside over around it.
GlassPlace glassPlace(float alpha, float eta, bool thin);
// E of a direction by its cosine, (0, 1].
float glassAlbedo(const GlassPlace& place, float cosine);

}  // namespace braid
