// SPDX-License-Identifier: Apache-2.0
// How much light a GGX or a sheen layer reflects from one direction, integrated over the hemisphere: what is left for
// the layer below. Tables built once, on first use, by fixed quadrature; constant afterwards.
#pragma once

#include "renderer/core/vec.h"

namespace braid {

// Albedo of a GGX layer with Schlick's Fresnel term is F0·f0 + F90·f90 (Karis 2013, the "split sum").
struct GgxAlbedo {
  float f0, f90;
};

// A place between two rows of a table, found once per surface.
struct TableRow {
  int row;
  float fraction;
};

TableRow ggxTableRow(float alpha);
GgxAlbedo ggxAlbedo(const TableRow& row, float cosine);
// The cosine-weighted mean over all directions, consistent with the interpolated table.
GgxAlbedo ggxMeanAlbedo(const TableRow& row);

// The same for a Fresnel term that is no Schlick curve (thin film, exact dielectric): its values at
// cosine k / (kFresnelNodes - 1), taken as linear in between.
inline constexpr int kFresnelNodes = 16;
float ggxAlbedo(const TableRow& row, float cosine, const float* nodes);
float ggxMeanAlbedo(const TableRow& row, const float* nodes);

// Albedo of the Charlie sheen of KHR_materials_sheen with white colour. Roughness is the perceptual one.
// TRAP: below roughness 0.25 the model reflects up to 2.7 times the light at grazing angles; users must scale it down.
TableRow sheenTableRow(float roughness);
float sheenAlbedo(const TableRow& row, float cosine);

}  // namespace braid
