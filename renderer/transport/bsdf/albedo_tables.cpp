// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/bsdf/albedo_tables.h"

#include <array>
#include <algorithm>
#include <cmath>
#include <memory>

#include "renderer/transport/bsdf/fresnel.h"
#include "renderer/transport/bsdf/microfacet.h"
#include "renderer/transport/bsdf/sheen.h"

namespace braid {
namespace {

// Rows are uniform in sqrt(alpha), columns in sqrt(cosine): both crowd where albedos change fast.
constexpr int kRows = 32, kColumns = 32;

struct GgxNode {
  GgxAlbedo schlick{};
  std::array<float, kFresnelNodes> hats{};  // albedo under a Fresnel term that is a hat around node k
};

struct GgxTable {
  std::array<std::array<GgxNode, kColumns>, kRows> at;
  std::array<GgxNode, kRows> mean;
};

struct SheenTable {
  std::array<std::array<float, kColumns>, kRows> at;
};

float columnCosine(int column) { return std::max(sqr(static_cast<float>(column) / (kColumns - 1)), 1e-4f); }

TableRow place(float coordinate, int count) {
  const float x = glm::clamp(coordinate, 0.0f, 1.0f) * static_cast<float>(count - 1);
  const int i = std::min(static_cast<int>(x), count - 2);
  return {i, x - static_cast<float>(i)};
}

void addSample(GgxNode& node, float voh, float weight) {
  const float s = schlickWeight(voh);
  node.schlick.f0 += weight * (1 - s);
  node.schlick.f90 += weight * s;
  const TableRow k = place(voh, kFresnelNodes);
  node.hats[static_cast<size_t>(k.row)] += weight * (1 - k.fraction);
  node.hats[static_cast<size_t>(k.row) + 1] += weight * k.fraction;
}

// Midpoint rule over the visible normals; the integrand is then F·G2/G1, smooth and at most 1.
GgxNode integrateGgx(float alpha, float cosine) {
  GgxNode node;
  if (alpha < Ggx::kMinAlpha) {  // a mirror: the Fresnel term itself
    addSample(node, cosine, 1);
    return node;
  }
  constexpr int kPhi = 12, kZ = 32;
  const Ggx ggx{alpha, alpha};
  const Vec3 wo(safeSqrt(1 - sqr(cosine)), 0, cosine);
  const float stretchO = ggx.stretch(wo);
  for (int i = 0; i < kPhi; ++i) {
    for (int j = 0; j < kZ; ++j) {
      // Half a turn is enough: wo lies in the plane of symmetry.
      const Vec2 u((static_cast<float>(i) + 0.5f) / (2 * kPhi), (static_cast<float>(j) + 0.5f) / kZ);
      const Vec3 h = ggx.sampleVisibleNormal(wo, stretchO, u);
      const float voh = glm::dot(wo, h);
      const Vec3 wi = 2 * voh * h - wo;
      if (!(wi.z > 0)) continue;
      const float weight = wi.z * (cosine + stretchO) / (wi.z * stretchO + cosine * ggx.stretch(wi));
      addSample(node, voh, weight / (kPhi * kZ));
    }
  }
  return node;
}

// Weight of each column in 2 ∫ E(mu) mu dmu for E linear in sqrt(mu): exact moments of the hats against 4 x³ dx.
std::array<float, kColumns> meanWeights() {
  std::array<float, kColumns> w{};
  const double step = 1.0 / (kColumns - 1);
  for (int i = 0; i + 1 < kColumns; ++i) {
    const double lo = i * step, hi = lo + step;
    const double m3 = std::pow(hi, 4) - std::pow(lo, 4);
    const double m4 = 0.8 * (std::pow(hi, 5) - std::pow(lo, 5));
    const double upper = (m4 - lo * m3) / step;
    w[static_cast<size_t>(i)] += static_cast<float>(m3 - upper);
    w[static_cast<size_t>(i) + 1] += static_cast<float>(upper);
  }
  return w;
}

std::unique_ptr<const GgxTable> buildGgx() {
  auto table = std::make_unique<GgxTable>();
  const auto weights = meanWeights();
  for (size_t r = 0; r < kRows; ++r) {
    GgxNode& mean = table->mean[r];
    for (size_t c = 0; c < kColumns; ++c) {
      const float alpha = sqr(static_cast<float>(r) / (kRows - 1));
      const GgxNode& node = table->at[r][c] = integrateGgx(alpha, columnCosine(static_cast<int>(c)));
      mean.schlick.f0 += weights[c] * node.schlick.f0;
      mean.schlick.f90 += weights[c] * node.schlick.f90;
      for (size_t k = 0; k < kFresnelNodes; ++k) mean.hats[k] += weights[c] * node.hats[k];
    }
  }
  return table;
}

// Midpoint rule in angle, which resolves the rim where sheen lives.
float integrateSheen(float roughness, float cosine) {
  constexpr int kTheta = 48, kPhi = 12;
  const Charlie charlie(roughness);
  const Vec3 wo(safeSqrt(1 - sqr(cosine)), 0, cosine);
  const float lambdaO = charlie.lambda(cosine);
  float sum = 0;
  for (int i = 0; i < kTheta; ++i) {
    const float theta = (static_cast<float>(i) + 0.5f) * (0.5f * kPi / kTheta);
    const float z = std::cos(theta), r = std::sin(theta);
    float ring = 0;
    for (int j = 0; j < kPhi; ++j) {
      const float phi = (static_cast<float>(j) + 0.5f) * (kPi / kPhi);
      const Vec3 h = glm::normalize(wo + Vec3(r * std::cos(phi), r * std::sin(phi), z));
      ring += charlie.D(sqr(h.x) + sqr(h.y));
    }
    sum += ring * r / (1 + lambdaO + charlie.lambda(z));
  }
  return sum * (2 * kPi / kPhi) * (0.5f * kPi / kTheta) / (4 * cosine);
}

std::unique_ptr<const SheenTable> buildSheen() {
  auto table = std::make_unique<SheenTable>();
  for (size_t r = 0; r < kRows; ++r) {
    for (size_t c = 0; c < kColumns; ++c) {
      table->at[r][c] = integrateSheen(static_cast<float>(r) / (kRows - 1), columnCosine(static_cast<int>(c)));
    }
  }
  return table;
}

const GgxTable& ggxTable() {
  static const std::unique_ptr<const GgxTable> table = buildGgx();
  return *table;
}

const SheenTable& sheenTable() {
  static const std::unique_ptr<const SheenTable> table = buildSheen();
  return *table;
}

TableRow column(float cosine) { return place(std::sqrt(std::max(cosine, 0.0f)), kColumns); }

float mixHats(const GgxNode& node, const float* nodes) {
  float sum = 0;
  for (size_t k = 0; k < kFresnelNodes; ++k) sum += node.hats[k] * nodes[k];
  return sum;
}

}  // namespace

TableRow ggxTableRow(float alpha) { return place(std::sqrt(alpha), kRows); }

GgxAlbedo ggxAlbedo(const TableRow& row, float cosine) {
  const GgxTable& table = ggxTable();
  const TableRow c = column(cosine);
  const auto r = static_cast<size_t>(row.row), i = static_cast<size_t>(c.row);
  const float w11 = row.fraction * c.fraction, w10 = row.fraction - w11;
  const float w01 = c.fraction - w11, w00 = 1 - row.fraction - w01;
  const GgxAlbedo& e00 = table.at[r][i].schlick;
  const GgxAlbedo& e01 = table.at[r][i + 1].schlick;
  const GgxAlbedo& e10 = table.at[r + 1][i].schlick;
  const GgxAlbedo& e11 = table.at[r + 1][i + 1].schlick;
  return {w00 * e00.f0 + w01 * e01.f0 + w10 * e10.f0 + w11 * e11.f0,
          w00 * e00.f90 + w01 * e01.f90 + w10 * e10.f90 + w11 * e11.f90};
}

GgxAlbedo ggxMeanAlbedo(const TableRow& row) {
  const GgxTable& table = ggxTable();
  const GgxAlbedo& lo = table.mean[static_cast<size_t>(row.row)].schlick;
  const GgxAlbedo& hi = table.mean[static_cast<size_t>(row.row) + 1].schlick;
  return {glm::mix(lo.f0, hi.f0, row.fraction), glm::mix(lo.f90, hi.f90, row.fraction)};
}

float ggxAlbedo(const TableRow& row, float cosine, const float* nodes) {
  const GgxTable& table = ggxTable();
  const TableRow c = column(cosine);
  const auto r = static_cast<size_t>(row.row), i = static_cast<size_t>(c.row);
  const float lo = glm::mix(mixHats(table.at[r][i], nodes), mixHats(table.at[r][i + 1], nodes), c.fraction);
  const float hi = glm::mix(mixHats(table.at[r + 1][i], nodes), mixHats(table.at[r + 1][i + 1], nodes), c.fraction);
  return glm::mix(lo, hi, row.fraction);
}

float ggxMeanAlbedo(const TableRow& row, const float* nodes) {
  const GgxTable& table = ggxTable();
  const auto r = static_cast<size_t>(row.row);
  return glm::mix(mixHats(table.mean[r], nodes), mixHats(table.mean[r + 1], nodes), row.fraction);
}

TableRow sheenTableRow(float roughness) { return place(roughness, kRows); }

float sheenAlbedo(const TableRow& row, float cosine) {
  const SheenTable& table = sheenTable();
  const TableRow c = column(cosine);
  const auto r = static_cast<size_t>(row.row), i = static_cast<size_t>(c.row);
  return glm::mix(glm::mix(table.at[r][i], table.at[r][i + 1], c.fraction),
                  glm::mix(table.at[r + 1][i], table.at[r + 1][i + 1], c.fraction), row.fraction);
}

}  // namespace braid
