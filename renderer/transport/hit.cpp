// SPDX-License-Identifier: Apache-2.0
#include "renderer/transport/hit.h"

#include <algorithm>

namespace braid {

namespace {

// Bound on the relative error of n rounded operations (Higham 2002; Pharr et al. 2023, section 6.8.1).
constexpr float gammaBound(float n) {
  constexpr float unit = 0.5f * std::numeric_limits<float>::epsilon();
  return n * unit / (1 - n * unit);
}

// Tangent-space normal of a map: x, y scaled, then unit.
Vec3 mapNormal(const Vec4& texel, float scale) {
  const Vec3 n((2 * texel.x - 1) * scale, (2 * texel.y - 1) * scale, 2 * texel.z - 1);
  const float length = glm::length(n);
  return length > 0 && std::isfinite(length) ? n / length : Vec3(0, 0, 1);
}

// The cross product of a triangle's edges as a unit vector. That of a 10⁻⁸ m triangle underflows when squared, so small
// ones are scaled first; `fallback` when it is zero.
Vec3 unitNormal(const Vec3& n, const Vec3& fallback) {
  const float length2 = glm::dot(n, n);
  if (length2 > 1e-30f && length2 < 1e30f) return n * (1 / std::sqrt(length2));
  const float largest = maxComponent(magnitudes(n));
  return largest > 0 && largest < kInfinity ? glm::normalize(n / largest) : fallback;
}

Frame tangentFrame(const Vec3& normal, const Vec4& tangent) {
  const Vec3 t = Vec3(tangent) - normal * glm::dot(normal, Vec3(tangent));
  const float length = glm::length(t);
  if (!(length > 1e-6f)) return Frame(normal);
  const Vec3 s = t / length;
  return Frame(s, glm::cross(normal, s) * (tangent.w < 0 ? -1.0f : 1.0f), normal);
}

// A tangent of the mesh at a hit, in the world.
Vec4 tangentAt(const Scene& scene, const std::vector<Vec4>& tangents, const Hit& hit) {
  const Vec4 tangent = interpolate(tangents, hit.mesh->triangles[hit.triangle], hit.u, hit.v);
  if (hit.instance == kNoInstance) return tangent;
  const Mat3 linear(scene.instances()[hit.instance].toWorld);
  return Vec4(linear * Vec3(tangent), glm::determinant(linear) < 0 ? -tangent.w : tangent.w);
}

// Tangents of the frame that a texture of the material follows (Material::coatFrame), if they are others than those of
// the shading frame.
const std::vector<Vec4>* otherTangents(const TriangleMesh& mesh, uint8_t frame) {
  if (frame == 0 || mesh.otherTangents[frame - 1].empty()) return nullptr;
  return &mesh.otherTangents[frame - 1];
}

}  // namespace

void makeHit(const Scene& scene, const RayHit& query, const Vec3& direction, Hit& hit) {
  const TriangleMesh& mesh = scene.mesh(query.mesh);
  const glm::uvec3 index = mesh.triangles[query.triangle];
  const float u = query.u, v = query.v, w = 1 - u - v;
  const Vec3 &p0 = mesh.positions[index.x], &p1 = mesh.positions[index.y], &p2 = mesh.positions[index.z];
  hit.mesh = &mesh;
  hit.material = &scene.material(mesh);
  hit.meshIndex = query.mesh;
  hit.triangle = query.triangle;
  hit.instance = query.instance;
  hit.u = u;
  hit.v = v;
  hit.distance = query.t;
  hit.wo = -direction;

  const Vec3 a = w * p0, b = u * p1, c = v * p2;
  hit.position = a + b + c;
  // TRAP: the bound must not be taken coordinate by coordinate: on the plane z = 0 it would be 0, yet Embree's distance
  // to that plane has the rounding errors of the triangle's other coordinates in it.
  const Vec3 largest3 = glm::max(glm::max(magnitudes(p0), magnitudes(p1)), magnitudes(p2));
  hit.positionError = gammaBound(8) * maxComponent(largest3);
  Vec3 ng = glm::cross(p1 - p0, p2 - p0);
  Vec3 ns = mesh.normals.empty() ? ng : interpolate(mesh.normals, index, u, v);
  Vec4 tangent = mesh.tangents.empty() ? Vec4(0) : interpolate(mesh.tangents, index, u, v);

  if (query.instance != kNoInstance) {
    const GroupInstance& instance = scene.instances()[query.instance];
    const Mat3 linear(instance.toWorld);
    const Mat3 absolute(magnitudes(linear[0]), magnitudes(linear[1]), magnitudes(linear[2]));
    const Vec3 translation(instance.toWorld[3]);
    const Vec3 rounding = (1 + gammaBound(3)) * (absolute * Vec3(hit.positionError)) +
                          gammaBound(4) * (absolute * magnitudes(hit.position) + magnitudes(translation));
    hit.positionError = maxComponent(rounding);
    hit.position = linear * hit.position + translation;
    // Normals go by the inverse transpose; that keeps the front side also in a mirrored instance.
    const Mat3 normalMatrix = glm::transpose(Mat3(instance.toObject));
    ng = normalMatrix * ng;
    ns = normalMatrix * ns;
    tangent = Vec4(linear * Vec3(tangent), glm::determinant(linear) < 0 ? -tangent.w : tangent.w);
  }

  ng = unitNormal(ng, hit.wo);
  hit.front = glm::dot(hit.wo, ng) >= 0;
  if (mesh.normals.empty()) {
    ns = ng;
  } else {
    const float length2 = glm::dot(ns, ns);
    ns = length2 > 0 && std::isfinite(length2) ? ns * (1 / std::sqrt(length2)) : ng;
    if (glm::dot(ns, ng) < 0) ns = -ns;
  }
  hit.smoothNormal = ns;

  const Material& material = *hit.material;
  // Tangents that the material does not read must not turn the frame: an image would depend on what the loader keeps.
  if (mesh.tangents.empty() || !material.needsTangents()) {
    hit.frame = Frame(hit.front ? ns : -ns);
  } else {
    Frame frame = tangentFrame(ns, tangent);
    if (material.normalTexture) {
      const Vec3 local =
          mapNormal(scene.lookup(material.normalTexture, mesh, query.triangle, u, v), material.normalScale);
      // Shading must stay consistent with geometry: a mapped normal below the surface would mirror light into it.
      const Vec3 mapped = frame.toWorld(local);
      if (glm::dot(mapped, ng) > 1e-3f) frame = tangentFrame(glm::normalize(mapped), Vec4(frame.s, tangent.w));
    }
    if (!hit.front) frame = Frame(frame.s, -frame.t, -frame.n);
    hit.frame = frame;
  }
  hit.ng = hit.front ? ng : -ng;
  if (!hit.front) hit.smoothNormal = -hit.smoothNormal;
}

uint32_t materialLobes(const Material& m) {
  uint32_t lobes = 0;
  if (m.specularGlossiness) return kLobeDiffuse | kLobeSpecular | kLobeSpecularGlossiness;
  const bool allMetal = m.metallic >= 1 && !m.metallicRoughnessTexture;
  const bool dielectric = !allMetal;
  const bool allTransmission = m.transmission >= 1 && !m.transmissionTexture;
  if (dielectric && !allTransmission) {
    if (m.diffuseTransmission < 1 || m.diffuseTransmissionTexture) lobes |= kLobeDiffuse;
    if (m.diffuseTransmission > 0) lobes |= kLobeDiffuseTransmission;
  }
  if (m.metallic > 0 || m.specular > 0 || m.transmission > 0) lobes |= kLobeSpecular;
  if (dielectric && m.transmission > 0) lobes |= kLobeTransmission;
  if (m.clearcoat > 0) lobes |= kLobeClearcoat;
  if (maxComponent(m.sheenColor) > 0) lobes |= kLobeSheen;
  if (m.iridescence > 0) lobes |= kLobeIridescence;
  if (m.anisotropy != 0) lobes |= kLobeAnisotropy;
  return lobes;
}

Spectrum baseColorAt(const Scene& scene, const Hit& hit) {
  const Material& m = *hit.material;
  Spectrum color = m.baseColor;
  if (m.baseColorTexture)  // of floats, it may be above 1
    color *= glm::min(Spectrum(scene.lookup(m.baseColorTexture, *hit.mesh, hit.triangle, hit.u, hit.v)), Spectrum(1));
  if (!hit.mesh->colors.empty())
    color *= Spectrum(interpolate(hit.mesh->colors, hit.mesh->triangles[hit.triangle], hit.u, hit.v));
  return color;
}

namespace {

void evaluateLayers(const Scene& scene, const Hit& hit, SurfaceParameters& s) {
  const Material& m = *hit.material;
  const auto tex = [&](const TextureRef& ref) { return scene.lookup(ref, *hit.mesh, hit.triangle, hit.u, hit.v); };
  if (s.lobes & kLobeClearcoat) {
    s.clearcoat = m.clearcoat * (m.clearcoatTexture ? tex(m.clearcoatTexture).r : 1.0f);
    s.clearcoatRoughness =
        m.clearcoatRoughness * (m.clearcoatRoughnessTexture ? tex(m.clearcoatRoughnessTexture).g : 1.0f);
    Vec3 coat = hit.smoothNormal;
    if (const auto* tangents = otherTangents(*hit.mesh, m.coatFrame); tangents && m.clearcoatNormalTexture) {
      const Vec3 front = hit.front ? hit.smoothNormal : -hit.smoothNormal;
      const Frame f = tangentFrame(front, tangentAt(scene, *tangents, hit));
      const Vec3 local = mapNormal(tex(m.clearcoatNormalTexture), m.clearcoatNormalScale);
      const Vec3 mapped = hit.front ? f.toWorld(local) : Frame(f.s, -f.t, -f.n).toWorld(local);
      if (glm::dot(mapped, hit.ng) > 1e-3f) coat = mapped;
    } else if (m.clearcoatNormalTexture && !hit.mesh->tangents.empty()) {
      const Frame smooth(hit.frame.s - hit.smoothNormal * glm::dot(hit.frame.s, hit.smoothNormal), Vec3(0),
                         hit.smoothNormal);
      const Vec3 t = glm::normalize(smooth.s);
      const Vec3 bitangent = glm::cross(hit.smoothNormal, t) *
                             (glm::dot(glm::cross(hit.frame.n, hit.frame.s), hit.frame.t) < 0 ? -1.0f : 1.0f);
      const Vec3 mapped = Frame(t, bitangent, hit.smoothNormal)
                              .toWorld(mapNormal(tex(m.clearcoatNormalTexture), m.clearcoatNormalScale));
      if (glm::dot(mapped, hit.ng) > 1e-3f) coat = mapped;
    }
    s.clearcoatNormal = glm::normalize(hit.frame.toLocal(coat));
  }
  if (s.lobes & kLobeSheen) {
    s.sheenColor = m.sheenColor * (m.sheenColorTexture ? Spectrum(tex(m.sheenColorTexture)) : Spectrum(1));
    s.sheenRoughness = m.sheenRoughness * (m.sheenRoughnessTexture ? tex(m.sheenRoughnessTexture).a : 1.0f);
  }
  if (s.lobes & kLobeAnisotropy) {
    s.anisotropy = m.anisotropy;
    Vec2 direction(1, 0);
    if (m.anisotropyTexture) {
      const Vec4 t = tex(m.anisotropyTexture);
      direction = Vec2(2 * t.r - 1, 2 * t.g - 1);
      s.anisotropy *= t.b;
    }
    const float c = std::cos(m.anisotropyRotation), si = std::sin(m.anisotropyRotation);
    direction = Vec2(c * direction.x - si * direction.y, si * direction.x + c * direction.y);
    const float length = glm::length(direction);
    s.anisotropyDirection = length > 0 ? direction / length : Vec2(1, 0);
    if (const auto* tangents = otherTangents(*hit.mesh, m.anisotropyFrame)) {
      const Frame f = tangentFrame(hit.front ? hit.frame.n : -hit.frame.n, tangentAt(scene, *tangents, hit));
      const Vec2 d = s.anisotropyDirection;
      s.anisotropyDirection = Vec2(hit.frame.toLocal(d.x * f.s + d.y * f.t));
    } else if (!hit.front) {
      s.anisotropyDirection.y = -s.anisotropyDirection.y;  // the frame's bitangent is turned on back faces
    }
  }
  if (s.lobes & kLobeIridescence) {
    s.iridescence = m.iridescence * (m.iridescenceTexture ? tex(m.iridescenceTexture).r : 1.0f);
    s.iridescenceIor = m.iridescenceIor;
    const float t = m.iridescenceThicknessTexture ? tex(m.iridescenceThicknessTexture).g : 1.0f;
    s.iridescenceThickness = m.iridescenceThicknessMin + (m.iridescenceThicknessMax - m.iridescenceThicknessMin) * t;
  }
}

}  // namespace

SurfaceParameters surfaceAt(const Scene& scene, const Hit& hit, uint32_t lobes, float etaOutside) {
  const Material& m = *hit.material;
  const auto tex = [&](const TextureRef& ref) { return scene.lookup(ref, *hit.mesh, hit.triangle, hit.u, hit.v); };
  SurfaceParameters s;
  s.lobes = lobes;
  s.baseColor = baseColorAt(scene, hit);
  if (lobes == kLobeDiffuse) return s;

  s.metallic = m.metallic;
  s.roughness = m.roughness;
  if (m.metallicRoughnessTexture) {
    const Vec4 t = tex(m.metallicRoughnessTexture);
    s.roughness *= t.g;
    s.metallic *= t.b;
  }
  s.etaInside = m.ior;
  s.etaOutside = etaOutside;
  s.entering = hit.front;
  s.thinWalled = m.thinWalled;
  s.specular = m.specular * (m.specularTexture ? tex(m.specularTexture).a : 1.0f);
  s.specularColor = m.specularColor * (m.specularColorTexture ? Spectrum(tex(m.specularColorTexture)) : Spectrum(1));
  if (lobes & kLobeSpecularGlossiness) {
    s.metallic = 0;
    s.specularF0 = m.specularF0;
    if (m.specularGlossinessTexture) {
      const Vec4 t = tex(m.specularGlossinessTexture);
      s.specularF0 *= Spectrum(t);
      s.roughness = 1 - (1 - m.roughness) * t.a;
    }
  }
  if (lobes & kLobeTransmission)
    s.transmission = m.transmission * (m.transmissionTexture ? tex(m.transmissionTexture).r : 1.0f);
  if (lobes & kLobeDiffuseTransmission) {
    s.diffuseTransmission =
        m.diffuseTransmission * (m.diffuseTransmissionTexture ? tex(m.diffuseTransmissionTexture).a : 1.0f);
    s.diffuseTransmissionColor =
        m.diffuseTransmissionColor *
        (m.diffuseTransmissionColorTexture ? Spectrum(tex(m.diffuseTransmissionColorTexture)) : Spectrum(1));
  }
  if (lobes & (kLobeClearcoat | kLobeSheen | kLobeAnisotropy | kLobeIridescence)) evaluateLayers(scene, hit, s);
  return s;
}

}  // namespace braid
