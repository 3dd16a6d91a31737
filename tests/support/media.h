// SPDX-License-Identifier: Apache-2.0
// Solids that scatter light within, and plain walks through slabs to compare them with.
#pragma once

#include <vector>

#include "tests/support/render_fixture.h"

namespace braid::test {

// A white solid of this index whose medium has a free path of `freePath` metres and an albedo for each event.
inline Material scatteringSolid(const Spectrum& albedo, float freePath, float ior, float roughness = 0) {
  Material m = diffuseMaterial(Spectrum(1));
  m.specular = 1;
  m.transmission = 1;
  m.roughness = roughness;
  m.ior = ior;
  m.thinWalled = false;
  m.doubleSided = false;
  m.scatterAlbedo = albedo;
  m.attenuationColor = Spectrum(std::exp(-1.0f));
  m.attenuationDistance = freePath;
  return m;
}

// As KHR_materials_volume_scatter recommends for wax: light enters and leaves as through paper.
inline Material wax(const Spectrum& albedo, float freePath) {
  Material m = scatteringSolid(albedo, freePath, 1.5f, 0.6f);
  m.transmission = 0;
  m.baseColor = Spectrum(0.8f);
  m.diffuseTransmission = 0.9f;
  return m;
}

inline TriangleMesh boxMesh(const Vec3& lo, const Vec3& hi) {
  const Vec3 d = hi - lo, x(d.x, 0, 0), y(0, d.y, 0), z(0, 0, d.z);
  TriangleMesh mesh;
  addQuad(mesh, lo, y, x);
  addQuad(mesh, lo, x, z);
  addQuad(mesh, lo, z, y);
  addQuad(mesh, hi, -x, -y);
  addQuad(mesh, hi, -z, -x);
  addQuad(mesh, hi, -y, -z);
  return mesh;
}

inline void addSolid(SceneData& data, TriangleMesh mesh, const Material& material) {
  data.materials.push_back(material);
  addMesh(data, std::move(mesh), static_cast<uint32_t>(data.materials.size() - 1));
}

// A solid alone in an environment of radiance 1.
inline SceneData inWhite(const Material& material, TriangleMesh mesh, const CameraData& camera) {
  SceneData data;
  addSolid(data, std::move(mesh), material);
  data.environment = EnvironmentData{nullptr, Spectrum(1), 0};
  data.cameras = {camera};
  return data;
}

// What light of radiance 1 from all around leaves of itself on a plain walk through a slab of `depth` free paths, by
// the albedo and anisotropy of events, entered at an angle to the normal with this cosine: in double, by the textbook.
inline Measured plainSlab(double albedo, double g, double depth, double cosine, int walks = 200000) {
  Rng rng(5);
  const auto next = [&] { return static_cast<double>(rng.next()); };
  double sum = 0, squares = 0;
  for (int i = 0; i < walks; ++i) {
    double z = 0, mu = cosine, weight = 1;
    for (;;) {
      z += -std::log(1 - next()) * mu;
      if (z < 0 || z > depth) break;
      weight *= albedo;
      if (weight < 1e-9) break;
      const double xi = next(), s = (1 - g * g) / (1 - g + 2 * g * xi);
      const double turn = g == 0 ? 2 * xi - 1 : (1 + g * g - s * s) / (2 * g);
      const double sine = std::sqrt(std::max(0.0, 1 - turn * turn)) * std::sqrt(std::max(0.0, 1 - mu * mu));
      mu = mu * turn + sine * std::cos(2 * 3.14159265358979323846 * next());
    }
    sum += weight;
    squares += weight * weight;
  }
  const double mean = sum / walks;
  return {mean, std::sqrt(std::max(0.0, squares / walks - mean * mean) / (walks - 1))};
}

// Chandrasekhar's H for isotropic events of this albedo, at a cosine, by iteration of
// 1 / H(m) = sqrt(1 - a) + (a / 2) ∫ m' H(m') / (m + m') dm' (Radiative Transfer, 1960, chapter V).
inline double chandrasekharH(double albedo, double cosine) {
  constexpr int kNodes = 400;
  std::vector<double> h(kNodes, 1), next(kNodes);
  const auto at = [](int i) { return (i + 0.5) / kNodes; };
  const auto inverse = [&](double m) {
    double sum = 0;
    for (int i = 0; i < kNodes; ++i) sum += at(i) * h[static_cast<size_t>(i)] / (m + at(i)) / kNodes;
    return std::sqrt(1 - albedo) + 0.5 * albedo * sum;
  };
  for (int round = 0; round < 60; ++round) {
    for (int i = 0; i < kNodes; ++i) next[static_cast<size_t>(i)] = 1 / inverse(at(i));
    for (int i = 0; i < kNodes; ++i)
      h[static_cast<size_t>(i)] = 0.5 * (h[static_cast<size_t>(i)] + next[static_cast<size_t>(i)]);
  }
  return 1 / inverse(cosine);
}

}  // namespace braid::test
