// SPDX-License-Identifier: Apache-2.0
// The tables, and what the specular layer makes of them.
#include "renderer/transport/bsdf/multi_scatter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <vector>

#include "renderer/transport/bsdf/fresnel.h"
#include "renderer/transport/bsdf/microfacet.h"
#include "renderer/transport/bsdf/specular_layer.h"

namespace braid {
namespace {

// Rows are uniform in sqrt(alpha), columns in sqrt(cosine), indices in the root of (η - 1) / (η + 1), up to η = 3.
constexpr size_t kAlphas = 20, kCosines = 32, kIndices = 21;
constexpr float kMostIndex = 0.5f;
constexpr int kIterations = 40;

// Cells of the quadrature over microfacets.
struct Cells {
  int phi, z;
};
constexpr Cells kMetalCells = {12, 48}, kGlassCells = {8, 32};
// From within a solid, where total reflection begins abruptly.
constexpr Cells kInsideCells = {20, 56};

using Columns = std::array<float, kCosines>;
using Rows = std::array<Columns, kAlphas>;

TableRow placeIn(float coordinate, size_t count) {
  const float x = glm::clamp(coordinate, 0.0f, 1.0f) * static_cast<float>(count - 1);
  const int i = std::min(static_cast<int>(x), static_cast<int>(count) - 2);
  return {i, x - static_cast<float>(i)};
}

TableRow columnOf(float cosine) { return placeIn(std::sqrt(std::max(cosine, 0.0f)), kCosines); }

float cosineOf(size_t column) { return std::max(sqr(static_cast<float>(column) / (kCosines - 1)), 1e-4f); }

float alphaOf(size_t row) { return std::max(sqr(static_cast<float>(row) / (kAlphas - 1)), Ggx::kMinAlpha); }

float along(const Columns& columns, const TableRow& at) {
  const auto c = static_cast<size_t>(at.row);
  return glm::mix(columns[c], columns[c + 1], at.fraction);
}

float inRows(const Rows& rows, const TableRow& alpha, const TableRow& column) {
  const auto r = static_cast<size_t>(alpha.row);
  return glm::mix(along(rows[r], column), along(rows[r + 1], column), alpha.fraction);
}

// Calls visit(h, cosine to h, weight) for the visible normals of a direction, by the midpoint rule. Cells are small
// where normals are steep: what is lost is lost there. Each ring is turned by the golden ratio against the one before,
// so that the edge of total reflection does not run along the grid.
template <class Visit>
void forVisibleNormals(const Ggx& ggx, const Vec3& wo, const Cells& cells, const Visit& visit) {
  const float stretch = ggx.stretch(wo);
  // The sum of the midpoints' 3 t² is 1 - 1 / (4 z²).
  const float sum = static_cast<float>(cells.phi * cells.z) * (1 - 0.25f / sqr(static_cast<float>(cells.z)));
  for (int k = 0; k < cells.phi * cells.z; ++k) {
    const auto ring = static_cast<float>(k / cells.phi);
    const float t = (ring + 0.5f) / static_cast<float>(cells.z);
    const float turn =
        (static_cast<float>(k % cells.phi) + glm::fract(0.61803399f * ring)) / static_cast<float>(cells.phi);
    const float weight = 3 * sqr(t) / sum;
    const Vec3 h = ggx.sampleVisibleNormal(wo, stretch, {turn, 1 - t * t * t});
    const float oh = glm::dot(wo, h);
    if (oh > 0) visit(h, oh, weight);
  }
}

Vec3 directionOf(float cosine) { return Vec3(safeSqrt(1 - sqr(cosine)), 0, cosine); }

// Height-correlated masking and shadowing, over the masking of wo.
float reflectedShare(const Ggx& ggx, const Vec3& wo, const Vec3& wi) {
  const float stretch = ggx.stretch(wo);
  return wi.z > 0 ? wi.z * (wo.z + stretch) / (wi.z * stretch + wo.z * ggx.stretch(wi)) : 0.0f;
}

// c of one roughness, by damped iteration.
Columns metalFactors(float alpha) {
  struct Arrival {
    TableRow column;
    float share;
  };
  const Ggx ggx{alpha, alpha};
  std::array<std::vector<Arrival>, kCosines> arrivals;
  for (size_t c = 0; c < kCosines; ++c) {
    const Vec3 wo = directionOf(cosineOf(c));
    forVisibleNormals(ggx, wo, kMetalCells, [&](const Vec3& h, float oh, float weight) {
      const Vec3 wi = 2 * oh * h - wo;
      if (wi.z > 0) arrivals[c].push_back({columnOf(wi.z), weight * reflectedShare(ggx, wo, wi)});
    });
  }
  Columns factors;
  factors.fill(1);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Columns before = factors;
    for (size_t c = 0; c < kCosines; ++c) {
      float received = 0;
      for (const Arrival& a : arrivals[c]) received += a.share * along(before, a.column);
      factors[c] = std::sqrt(before[c] / received);
    }
  }
  return factors;
}

// Reflected and transmitted share of the light from one direction, as SpecularLayer scatters it.
float whiteGlassAlbedo(float alpha, float cosine, float eta, bool thin) {
  const Cells cells = !thin && eta < 1 ? kInsideCells : kGlassCells;
  const Ggx ggx{alpha, alpha};
  const Vec3 wo = directionOf(cosine);
  const float f0 = fresnelF0(1, eta);
  float sum = 0;
  forVisibleNormals(ggx, wo, cells, [&](const Vec3& h, float oh, float weight) {
    const float f = thin ? f0 + (1 - f0) * schlickWeight(oh) : fresnelDielectric(oh, eta);
    const Vec3 mirrored = 2 * oh * h - wo;
    sum += weight * f * reflectedShare(ggx, wo, mirrored);
    if (!(f < 1)) return;
    const float cosT = thin ? 0.0f : refractedCosine(oh, eta);
    const Vec3 passed =
        thin ? Vec3(mirrored.x, mirrored.y, -mirrored.z) : glm::normalize((oh / eta - cosT) * h - wo / eta);
    if (passed.z < 0) sum += weight * (1 - f) * Ggx::G1(-passed.z, ggx.stretch(passed));
  });
  return sum;
}

struct MetalTable {
  Rows factor;
  std::array<float, kAlphas> meanAlbedo;
};

const MetalTable& metalTable() {
  static const auto built = [] {
    auto table = std::make_unique<MetalTable>();
    for (size_t r = 0; r < kAlphas; ++r) {
      table->factor[r] = metalFactors(alphaOf(r));
      const GgxAlbedo mean = ggxMeanAlbedo(ggxTableRow(alphaOf(r)));
      table->meanAlbedo[r] = mean.f0 + mean.f90;
    }
    return table;
  }();
  return *built;
}

enum class GlassSide : uint8_t { Outside, Inside, Thin };

Rows buildGlass(GlassSide side, size_t index) {
  // At the first one light goes straight on, but for what microfacets shadow.
  const float x = std::max(kMostIndex * sqr(static_cast<float>(index) / (kIndices - 1)), 1e-4f);
  const float eta = (1 + x) / (1 - x);
  Rows rows;
  for (size_t r = 0; r < kAlphas; ++r)
    for (size_t c = 0; c < kCosines; ++c)
      rows[r][c] =
          whiteGlassAlbedo(alphaOf(r), cosineOf(c), side == GlassSide::Inside ? 1 / eta : eta, side == GlassSide::Thin);
  return rows;
}

// Of one index, when it is first asked for: a scene has few of them, and all would take a fifth of a second.
const Rows& glassRows(GlassSide side, size_t index) {
  struct Table {
    std::array<Rows, kIndices> rows;
    std::array<std::once_flag, kIndices> built;
  };
  static std::array<Table, 3> tables;
  Table& table = tables[static_cast<size_t>(side)];
  std::call_once(table.built[index], [&] { table.rows[index] = buildGlass(side, index); });
  return table.rows[index];
}

}  // namespace

TableRow metalScatterRow(float alpha) { return placeIn(std::sqrt(alpha), kAlphas); }

float metalScatterFactor(const TableRow& row, float cosine) {
  return inRows(metalTable().factor, row, columnOf(cosine));
}

Spectrum metalScatterColour(const TableRow& row, const Spectrum& f0) {
  const std::array<float, kAlphas>& mean = metalTable().meanAlbedo;
  const auto r = static_cast<size_t>(row.row);
  const float e = glm::mix(mean[r], mean[r + 1], row.fraction);
  const Spectrum f = f0 + (1.0f - f0) * (1.0f / 21);  // Schlick's mean
  return f * e / (1.0f - f * (1 - e));
}

GlassPlace glassPlace(float alpha, float eta, bool thin) {
  const float x = (eta - 1) / (eta + 1);
  return {placeIn(std::sqrt(alpha), kAlphas), placeIn(std::sqrt(std::fabs(x) / kMostIndex), kIndices), thin,
          !thin && x < 0};
}

float glassAlbedo(const GlassPlace& place, float cosine) {
  const GlassSide side = place.thin ? GlassSide::Thin : place.inside ? GlassSide::Inside : GlassSide::Outside;
  const TableRow column = columnOf(cosine);
  const auto i = static_cast<size_t>(place.index.row);
  return glm::mix(inRows(glassRows(side, i), place.alpha, column), inRows(glassRows(side, i + 1), place.alpha, column),
                  place.index.fraction);
}

// What dielectrics do not reflect, diffuse lobes below get: only metals and transmission lose light.
void SpecularLayer::initMultiScatter(const SurfaceParameters& p, Transport transport) {
  transmissionShare_ = has(kLobeTransmission) ? p.transmissionShare() : 0.0f;
  if (!present() || smooth_ || passThrough_ || !(metallic_ > 0 || transmissionShare_ > 0))
    lobes_ &= ~uint32_t{kLobeMultiScatter};
  if (!has(kLobeMultiScatter)) return;
  // Of anisotropic layers that of the axis which asks for less.
  const float alpha = std::min(ggx_.alphaX, ggx_.alphaY);
  metalRow_ = metalScatterRow(alpha);
  metalRowAcross_ = metalScatterRow(std::max(ggx_.alphaX, ggx_.alphaY));
  metalScatter_ = metallic_ > 0 ? metallic_ * metalScatterColour(metalRow_, metalF0_) : Spectrum(0);
  fromLight_ = transport == Transport::Power;
  if (transmissionShare_ > 0)
    glass_ = glassPlace(alpha, refractive_ ? eta_ : p.etaInside / std::max(p.etaOutside, 1e-3f), !refractive_);
}

float SpecularLayer::metalFactor(float cosine) const {
  const float factor = metalScatterFactor(metalRow_, cosine);
  return has(kLobeAnisotropy) ? std::min(factor, metalScatterFactor(metalRowAcross_, cosine)) : factor;
}

// By the direction on the camera's side; wi below the surface is on the other one.
float SpecularLayer::glassFactor(float cosineI) const {
  if (!fromLight_) return glassO_;
  return 1 / glassAlbedo(cosineI > 0 ? glass_ : glass_.otherSide(), std::fabs(cosineI));
}

// The Fresnel term with what later microfacets add.
Spectrum SpecularLayer::reflectance(const Facet& facet) const {
  Spectrum result = facet.fresnel.reflect;
  if (!has(kLobeMultiScatter)) return result;
  Spectrum metal(0);
  if (metallic_ > 0) {
    metal = metalF0_ + (1.0f - metalF0_) * schlickWeight(glm::dot(facet.o, facet.h));
    result += metalScatter_ * metal * (metalO_ * metalFactor(facet.i.z) - 1);
  }
  if (transmissionShare_ > 0) {
    const Spectrum dielectric = glm::max(facet.fresnel.reflect - metallic_ * metal, Spectrum(0));
    result += dielectric * (transmissionShare_ * (glassFactor(facet.i.z) - 1));
  }
  return glm::max(result, Spectrum(0));  // rounding can leave less than nothing of almost nothing
}

}  // namespace braid
