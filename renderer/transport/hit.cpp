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

// Whether a texture of the material follows tangents (Material::coatFrame) other than those of the shading frame.
bool hasOtherTangents(const TriangleMesh& mesh, uint8_t frame) {
  return frame != 0 && !mesh.otherTangents[frame - 1].empty();
}

// Such a tangent at a hit, in the world.
Vec4 otherTangentAt(const Scene& scene, const Hit& hit, uint8_t frame) {
  const glm::uvec3& index = hit.mesh->triangles[hit.triangle];
  const auto at = [&](const MeshVertices& v) { return interpolate(v.otherTangents[frame - 1], index, hit.u, hit.v); };
  Vec4 tangent = at(*hit.mesh);
  if (hit.mesh->moves()) {
    const Moment m = momentAt(hit.time, hit.mesh->steps.size());
    tangent = between(at(hit.mesh->step(m.first)), at(hit.mesh->step(m.first + 1)), m.fraction);
  }
  if (hit.instance == kNoInstance) return tangent;
  GroupInstance moved;
  const Mat3 linear(scene.instanceAt(hit.instance, hit.time, moved).toWorld);
  return Vec4(linear * Vec3(tangent), glm::determinant(linear) < 0 ? -tangent.w : tangent.w);
}

// What a triangle's vertices give at a hit.
struct Interpolated {
  Vec3 ng, ns;  // not of unit length
  Vec4 tangent;
};

// The same of a mesh that moves: each vertex is between two steps first, as for Embree.
Interpolated interpolateMoving(const TriangleMesh& mesh, Hit& hit) {
  const glm::uvec3 index = mesh.triangles[hit.triangle];
  const Moment m = momentAt(hit.time, mesh.steps.size());
  const MeshVertices &a = mesh.step(m.first), &b = mesh.step(m.first + 1);
  Vec3 p[3], largest(0);
  for (int k = 0; k < 3; ++k) {
    const Vec3 &first = a.positions[index[k]], &second = b.positions[index[k]];
    p[k] = between(first, second, m.fraction);
    largest = glm::max(largest, glm::max(magnitudes(first), magnitudes(second)));
  }
  hit.position = (1 - hit.u - hit.v) * p[0] + hit.u * p[1] + hit.v * p[2];
  hit.positionError = gammaBound(16) * maxComponent(largest);
  const Vec3 ng = glm::cross(p[1] - p[0], p[2] - p[0]);
  const auto attribute = [&](const auto& first, const auto& second) {
    return between(interpolate(first, index, hit.u, hit.v), interpolate(second, index, hit.u, hit.v), m.fraction);
  };
  return {ng, mesh.normals.empty() ? ng : attribute(a.normals, b.normals),
          mesh.tangents.empty() ? Vec4(0) : attribute(a.tangents, b.tangents)};
}

// Also places the hit.
Interpolated interpolateAt(const TriangleMesh& mesh, Hit& hit) {
  const glm::uvec3 index = mesh.triangles[hit.triangle];
  const float u = hit.u, v = hit.v, w = 1 - u - v;
  const Vec3 &p0 = mesh.positions[index.x], &p1 = mesh.positions[index.y], &p2 = mesh.positions[index.z];
  const Vec3 a = w * p0, b = u * p1, c = v * p2;
  hit.position = a + b + c;
  // TRAP: the bound must not be taken coordinate by coordinate: on the plane z = 0 it would be 0, yet Embree's distance
  // to that plane has the rounding errors of the triangle's other coordinates in it.
  const Vec3 largest3 = glm::max(glm::max(magnitudes(p0), magnitudes(p1)), magnitudes(p2));
  hit.positionError = gammaBound(8) * maxComponent(largest3);
  const Vec3 ng = glm::cross(p1 - p0, p2 - p0);
  return {ng, mesh.normals.empty() ? ng : interpolate(mesh.normals, index, u, v),
          mesh.tangents.empty() ? Vec4(0) : interpolate(mesh.tangents, index, u, v)};
}

void toWorld(const GroupInstance& instance, Hit& hit, Interpolated& at) {
  // A moving one is between two transforms first, and inverted anew by every ray.
  const float operations = instance.motion == GroupInstance::kStill ? 4 : 16;
  const Mat3 linear(instance.toWorld);
  const Mat3 absolute(magnitudes(linear[0]), magnitudes(linear[1]), magnitudes(linear[2]));
  const Vec3 translation(instance.toWorld[3]);
  const Vec3 rounding = (1 + gammaBound(3)) * (absolute * Vec3(hit.positionError)) +
                        gammaBound(operations) * (absolute * magnitudes(hit.position) + magnitudes(translation));
  hit.positionError = maxComponent(rounding);
  hit.position = linear * hit.position + translation;
  // Normals go by the inverse transpose; that keeps the front side also in a mirrored instance.
  const Mat3 normalMatrix = glm::transpose(Mat3(instance.toObject));
  at.ng = normalMatrix * at.ng;
  at.ns = normalMatrix * at.ns;
  at.tangent = Vec4(linear * Vec3(at.tangent), glm::determinant(linear) < 0 ? -at.tangent.w : at.tangent.w);
}

// The shading frame about the normals on the front side.
Frame shadingFrame(const Scene& scene, const Hit& hit, const Interpolated& front) {
  const Material& material = *hit.material;
  // Tangents that the material does not read must not turn the frame: an image would depend on what the loader keeps.
  if (hit.mesh->tangents.empty() || !material.needsTangents()) return Frame(hit.front ? front.ns : -front.ns);
  Frame frame = tangentFrame(front.ns, front.tangent);
  if (material.normalTexture) {
    const Vec3 local =
        mapNormal(scene.lookup(material.normalTexture, *hit.mesh, hit.triangle, hit.u, hit.v), material.normalScale);
    // Shading must stay consistent with geometry: a mapped normal below the surface would mirror light into it.
    const Vec3 mapped = frame.toWorld(local);
    if (glm::dot(mapped, front.ng) > 1e-3f)
      frame = tangentFrame(glm::normalize(mapped), Vec4(frame.s, front.tangent.w));
  }
  return hit.front ? frame : Frame(frame.s, -frame.t, -frame.n);
}

}  // namespace

void makeHit(const Scene& scene, const RayHit& query, const Vec3& direction, Hit& hit) {
  const TriangleMesh& mesh = scene.mesh(query.mesh);
  hit.mesh = &mesh;
  hit.material = &scene.material(mesh);
  hit.meshIndex = query.mesh;
  hit.triangle = query.triangle;
  hit.instance = query.instance;
  hit.u = query.u;
  hit.v = query.v;
  hit.distance = query.t;
  hit.wo = -direction;

  hit.time = query.time;

  Interpolated at = mesh.moves() ? interpolateMoving(mesh, hit) : interpolateAt(mesh, hit);
  if (query.instance != kNoInstance) {
    GroupInstance moved;
    toWorld(scene.instanceAt(query.instance, query.time, moved), hit, at);
  }
  at.ng = unitNormal(at.ng, hit.wo);
  hit.front = glm::dot(hit.wo, at.ng) >= 0;
  if (mesh.normals.empty()) {
    at.ns = at.ng;
  } else {
    const float length2 = glm::dot(at.ns, at.ns);
    at.ns = length2 > 0 && std::isfinite(length2) ? at.ns * (1 / std::sqrt(length2)) : at.ng;
    if (glm::dot(at.ns, at.ng) < 0) at.ns = -at.ns;
  }
  hit.frame = shadingFrame(scene, hit, at);
  hit.ng = hit.front ? at.ng : -at.ng;
  hit.smoothNormal = hit.front ? at.ns : -at.ns;
}

void prefetchVertices(const Scene& scene, std::span<const RayHit> queries) {
  for (const RayHit& hit : queries)
    if (hit.t < kInfinity) __builtin_prefetch(&scene.mesh(hit.mesh).triangles[hit.triangle]);
  for (const RayHit& hit : queries) {
    if (!(hit.t < kInfinity)) continue;
    const TriangleMesh& mesh = scene.mesh(hit.mesh);
    const glm::uvec3& index = mesh.triangles[hit.triangle];
    for (int k = 0; k < 3; ++k) {
      __builtin_prefetch(&mesh.positions[index[k]]);
      if (!mesh.normals.empty()) __builtin_prefetch(&mesh.normals[index[k]]);
    }
  }
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

Spectrum emissionAt(const Scene& scene, const Hit& hit) {
  if (!hit.front && !hit.material->doubleSided) return Spectrum(0);
  return scene.emission(*hit.mesh, hit.triangle, hit.u, hit.v);
}

namespace {

// What the parameters of a lobe are read from.
class SurfacePoint {
 public:
  SurfacePoint(const Scene& scene, const Hit& hit) : scene_(scene), hit_(hit) {}
  const Material& material() const { return *hit_.material; }
  Vec4 texture(const TextureRef& ref) const { return scene_.lookup(ref, *hit_.mesh, hit_.triangle, hit_.u, hit_.v); }
  // The coat's own normal, in the local shading frame.
  Vec3 coatNormal() const {
    const Vec3 mapped = material().clearcoatNormalTexture ? mappedCoatNormal() : hit_.smoothNormal;
    return glm::normalize(hit_.frame.toLocal(glm::dot(mapped, hit_.ng) > 1e-3f ? mapped : hit_.smoothNormal));
  }
  Vec2 anisotropyDirection(Vec2 direction) const;

 private:
  Vec3 mappedCoatNormal() const;

  const Scene& scene_;
  const Hit& hit_;
};

Vec3 SurfacePoint::mappedCoatNormal() const {
  const Material& m = material();
  const Vec3& smooth = hit_.smoothNormal;
  if (hasOtherTangents(*hit_.mesh, m.coatFrame)) {
    const Frame f = tangentFrame(hit_.front ? smooth : -smooth, otherTangentAt(scene_, hit_, m.coatFrame));
    const Frame turned = hit_.front ? f : Frame(f.s, -f.t, -f.n);
    return turned.toWorld(mapNormal(texture(m.clearcoatNormalTexture), m.clearcoatNormalScale));
  }
  if (hit_.mesh->tangents.empty()) return smooth;
  const Frame& shading = hit_.frame;
  const Vec3 t = glm::normalize(shading.s - smooth * glm::dot(shading.s, smooth));
  const Vec3 bitangent =
      glm::cross(smooth, t) * (glm::dot(glm::cross(shading.n, shading.s), shading.t) < 0 ? -1.0f : 1.0f);
  return Frame(t, bitangent, smooth).toWorld(mapNormal(texture(m.clearcoatNormalTexture), m.clearcoatNormalScale));
}

// From the material's tangent space to the plane of the shading frame, as a unit vector.
Vec2 SurfacePoint::anisotropyDirection(Vec2 direction) const {
  const Material& m = material();
  const float c = std::cos(m.anisotropyRotation), si = std::sin(m.anisotropyRotation);
  direction = Vec2(c * direction.x - si * direction.y, si * direction.x + c * direction.y);
  const float length = glm::length(direction);
  const Vec2 d = length > 0 ? direction / length : Vec2(1, 0);
  if (hasOtherTangents(*hit_.mesh, m.anisotropyFrame)) {
    const Frame f =
        tangentFrame(hit_.front ? hit_.frame.n : -hit_.frame.n, otherTangentAt(scene_, hit_, m.anisotropyFrame));
    return Vec2(hit_.frame.toLocal(d.x * f.s + d.y * f.t));
  }
  return hit_.front ? d : Vec2(d.x, -d.y);  // the frame's bitangent is turned on back faces
}

void readAnisotropy(const SurfacePoint& at, SurfaceParameters& s) {
  const Material& m = at.material();
  s.anisotropy = m.anisotropy;
  Vec2 direction(1, 0);
  if (m.anisotropyTexture) {
    const Vec4 t = at.texture(m.anisotropyTexture);
    direction = Vec2(2 * t.r - 1, 2 * t.g - 1);
    s.anisotropy *= t.b;
  }
  s.anisotropyDirection = at.anisotropyDirection(direction);
}

void readIridescence(const SurfacePoint& at, SurfaceParameters& s) {
  const Material& m = at.material();
  s.iridescence = m.iridescence * (m.iridescenceTexture ? at.texture(m.iridescenceTexture).r : 1.0f);
  s.iridescenceIor = m.iridescenceIor;
  const float t = m.iridescenceThicknessTexture ? at.texture(m.iridescenceThicknessTexture).g : 1.0f;
  s.iridescenceThickness = m.iridescenceThicknessMin + (m.iridescenceThicknessMax - m.iridescenceThicknessMin) * t;
}

void readTransmission(const SurfacePoint& at, SurfaceParameters& s) {
  const Material& m = at.material();
  if (s.lobes & kLobeTransmission)
    s.transmission = m.transmission * (m.transmissionTexture ? at.texture(m.transmissionTexture).r : 1.0f);
  if (s.lobes & kLobeDiffuseTransmission) {
    s.diffuseTransmission =
        m.diffuseTransmission * (m.diffuseTransmissionTexture ? at.texture(m.diffuseTransmissionTexture).a : 1.0f);
    s.diffuseTransmissionColor =
        m.diffuseTransmissionColor *
        (m.diffuseTransmissionColorTexture ? Spectrum(at.texture(m.diffuseTransmissionColorTexture)) : Spectrum(1));
  }
}

}  // namespace

SurfaceParameters surfaceAt(const Scene& scene, const Hit& hit, uint32_t lobes, float etaOutside) {
  const Material& m = *hit.material;
  const SurfacePoint at(scene, hit);
  SurfaceParameters s;
  s.lobes = lobes;
  s.baseColor = baseColorAt(scene, hit);
  if (lobes == kLobeDiffuse) return s;

  s.metallic = m.metallic;
  s.roughness = m.roughness;
  if (m.metallicRoughnessTexture) {
    const Vec4 t = at.texture(m.metallicRoughnessTexture);
    s.roughness *= t.g;
    s.metallic *= t.b;
  }
  s.etaInside = m.ior;
  s.etaOutside = etaOutside;
  s.entering = hit.front;
  s.thinWalled = m.thinWalled;
  s.specular = m.specular * (m.specularTexture ? at.texture(m.specularTexture).a : 1.0f);
  s.specularColor =
      m.specularColor * (m.specularColorTexture ? Spectrum(at.texture(m.specularColorTexture)) : Spectrum(1));
  if (lobes & kLobeSpecularGlossiness) {
    s.metallic = 0;
    s.specularF0 = m.specularF0;
    if (m.specularGlossinessTexture) {
      const Vec4 t = at.texture(m.specularGlossinessTexture);
      s.specularF0 *= Spectrum(t);
      s.roughness = 1 - (1 - m.roughness) * t.a;
    }
  }
  if (lobes & kTransmittingLobes) readTransmission(at, s);
  if (lobes & kLobeAnisotropy) readAnisotropy(at, s);
  if (lobes & kLobeIridescence) readIridescence(at, s);
  if (lobes & Covers::kLobes) Covers::read(at, lobes, s);
  return s;
}

}  // namespace braid
