// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/scene.h"

#include <algorithm>
#include <map>

#include "renderer/core/error.h"
#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "renderer/scene/data/closed_mesh.h"
#include "renderer/scene/data/placement.h"
#include "renderer/scene/data/scene_defaults.h"

namespace braid {

Scene::Scene(SceneData data, const SceneOptions& options) : data_(std::move(data)) {
  const Stopwatch preparing;
  for (const TriangleMesh& mesh : data_.meshes) {
    BRAID_ASSERT(mesh.material < data_.materials.size());
    BRAID_ASSERT(!mesh.moves() || mesh.steps.size() + 1 == data_.motion.times.size());
  }
  if (data_.environment) environment_.emplace(*data_.environment);
  placeMeshes();
  findExtinctions();
  markFilteredMeshes(options.full);
  collectEmitters();
  detectTraits();
  times_.prepare = preparing.seconds();

  const Stopwatch building;
  AccelInput input;
  input.meshes = &data_.meshes;
  input.filtered = &filtered_;
  input.worldMeshes = &worldMeshes_;
  input.groups = &groups_;
  input.instances = &instances_;
  input.motions = &motions_;
  input.isa = options.isa;
  input.highQuality = options.highQuality.value_or(traits_.triangles <= 4'000'000);
  coincident_.emplace(input, reachableBacks_, opaque_);
  input.coincident = &*coincident_;
  const bool anyFilter = std::any_of(filtered_.begin(), filtered_.end(), [](uint8_t f) { return f != 0; });
  accel_.build(input, anyFilter ? this : nullptr);
  times_.hierarchy = building.seconds();
}

void Scene::addDefaultLight(DefaultLight kind, float scale, const std::string& warning) {
  giveDefaultLight(data_, kind, scale);
  data_.warnings.push_back(warning);
  environment_.emplace(*data_.environment);
  traits_.flags |= environment_->constant() ? kTraitEnvironment : kTraitEnvironment | kTraitEnvironmentImage;
}

namespace {

// At all times.
bool isSolid(const MeshInstance& instance) {
  const auto solid = [](const Mat4& m) { return shapeOf(glm::dmat4(m)) == Shape::Solid; };
  return solid(instance.toWorld) && std::all_of(instance.steps.begin(), instance.steps.end(), solid);
}

uint64_t placementKey(const std::vector<MeshInstance>& instances, const std::vector<size_t>& placements) {
  ContentHash hash;
  for (const size_t i : placements) {
    hash.add(&instances[i].toWorld, sizeof(Mat4));
    for (const Mat4& step : instances[i].steps) hash.add(&step, sizeof(Mat4));
  }
  return hash.value();
}

}  // namespace

// A mesh that one of several placements flattens, at any time, cannot be an instance there, because rays could not be
// brought into its coordinates; one that changes its shape in a place that moves would not move on straight lines: each
// gets a copy of its own.
void Scene::separateUnfit() {
  std::vector<uint32_t> count(data_.meshes.size(), 0);
  for (const MeshInstance& i : data_.instances) ++count[i.mesh];
  for (MeshInstance& i : data_.instances) {
    const bool straight = i.steps.empty() || !data_.meshes[i.mesh].moves();
    if (count[i.mesh] == 1 || (straight && isSolid(i))) continue;
    --count[i.mesh];
    TriangleMesh copy = data_.meshes[i.mesh];
    i.mesh = static_cast<uint32_t>(data_.meshes.size());
    data_.meshes.push_back(std::move(copy));
  }
}

// Meshes placed once are baked into world space, which spares every ray the instance transform; meshes placed several
// times, or moved as they are, keep one copy.
void Scene::placeMeshes() {
  separateUnfit();
  std::vector<std::vector<size_t>> placements(data_.meshes.size());
  for (size_t i = 0; i < data_.instances.size(); ++i) placements[data_.instances[i].mesh].push_back(i);
  std::vector<uint32_t> shared;
  for (uint32_t m = 0; m < data_.meshes.size(); ++m) {
    TriangleMesh& mesh = data_.meshes[m];
    if (placements[m].empty() || mesh.triangles.empty()) continue;
    const MeshInstance& instance = data_.instances[placements[m][0]];
    if (placements[m].size() > 1 || (!instance.steps.empty() && !mesh.moves() && isSolid(instance))) {
      shared.push_back(m);
    } else {
      transformMesh(mesh, instance.toWorld, instance.steps);
      worldMeshes_.push_back(m);
    }
    mesh.padForEmbree();
  }
  placeGroups(shared, placements);
  findBounds();
}

// Meshes with the same list of placements form a group, so that a tree's trunk and leaves are one instance.
void Scene::placeGroups(const std::vector<uint32_t>& shared, const std::vector<std::vector<size_t>>& placements) {
  std::map<uint64_t, std::vector<uint32_t>> byPlacement;
  std::vector<uint64_t> order;
  for (const uint32_t m : shared) {
    const uint64_t key = placementKey(data_.instances, placements[m]);
    auto [entry, isNew] = byPlacement.try_emplace(key);
    if (isNew) order.push_back(key);
    entry->second.push_back(m);
  }
  for (uint64_t key : order) {
    const std::vector<uint32_t>& meshes = byPlacement[key];
    const auto group = static_cast<uint32_t>(groups_.size());
    groups_.push_back({meshes});
    for (size_t i : placements[meshes[0]]) {
      const MeshInstance& source = data_.instances[i];
      GroupInstance instance;
      instance.group = group;
      instance.toWorld = source.toWorld;
      instance.toObject = glm::inverse(instance.toWorld);
      if (!source.steps.empty()) {
        instance.motion = static_cast<uint32_t>(motions_.size());
        motions_.push_back({source.toWorld});
        motions_.back().insert(motions_.back().end(), source.steps.begin(), source.steps.end());
      }
      instances_.push_back(instance);
    }
  }
}

// Of all that is there at any time.
void Scene::findBounds() {
  const auto extend = [&](Bounds& bounds, uint32_t m) {
    for (size_t k = 0; k <= data_.meshes[m].steps.size(); ++k)
      for (const Vec3& p : data_.meshes[m].step(k).positions) bounds.extend(p);
  };
  for (uint32_t m : worldMeshes_) extend(bounds_, m);
  std::vector<Bounds> groupBounds(groups_.size());
  for (size_t g = 0; g < groups_.size(); ++g)
    for (uint32_t m : groups_[g].meshes) extend(groupBounds[g], m);
  for (const GroupInstance& instance : instances_) {
    const Bounds& b = groupBounds[instance.group];
    const auto place = [&](const Mat4& toWorld) {
      for (int corner = 0; corner < 8; ++corner)
        bounds_.extend(Vec3(toWorld * Vec4(corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y,
                                           corner & 4 ? b.hi.z : b.lo.z, 1)));
    };
    place(instance.toWorld);
    if (instance.motion != GroupInstance::kStill)
      for (const Mat4& step : motions_[instance.motion]) place(step);
  }
}

// Media that scatter. A mean free path is at least this share of the largest coordinate: floats resolve no shorter one,
// and a denser medium looks alike, as its colour does not depend on its density.
void Scene::findExtinctions() {
  constexpr float kLeastFreePath = 0x1p-16f;
  const float extent =
      bounds_.empty() ? 1 : std::max(maxComponent(magnitudes(bounds_.lo)), maxComponent(magnitudes(bounds_.hi)));
  for (Material& m : data_.materials) {
    m.extinction = Spectrum(0);
    if (!m.scatters()) continue;
    for (int c = 0; c < 3; ++c)
      m.extinction[c] = std::min(-std::log(m.attenuationColor[c]) / m.attenuationDistance,
                                 1 / (kLeastFreePath * std::max(extent, 1e-30f)));
  }
}

// A mesh needs the any-hit filter when rays may pass through its triangles: alpha, or culled back faces of an open
// single-sided surface. A closed outward-facing surface is never seen from behind, so its back faces need no culling.
void Scene::markFilteredMeshes(bool full) {
  filtered_.assign(data_.meshes.size(), 0);
  reachableBacks_ = opaque_ = filtered_;
  parallelFor(data_.meshes.size(), [&](size_t m) {
    const TriangleMesh& mesh = data_.meshes[m];
    const Material& material = data_.materials[mesh.material];
    opaque_[m] = !material.transmissive() && material.diffuseTransmission == 0;
    const bool culled = !material.doubleSided && opaque_[m];
    const bool open = culled && !isClosedOutward(mesh);
    filtered_[m] = full || material.alphaMode != AlphaMode::Opaque || open;
    // Lamps that shine to both sides stay seen from both: light samples cannot tell what covers one.
    reachableBacks_[m] = open || (material.doubleSided && !material.emissive());
  });
}

void setShape(EmissiveTriangle& e, const Vec3* corners, bool mirrored) {
  e.p0 = corners[0];
  e.e1 = corners[1] - e.p0;
  e.e2 = corners[2] - e.p0;
  // In double: a triangle of 10⁻⁸ m sides would underflow in float.
  glm::dvec3 cross = glm::cross(glm::dvec3(e.e1), glm::dvec3(e.e2));
  if (mirrored) cross = -cross;
  const double length = glm::length(cross);
  e.normal = length > 0 ? Vec3(cross / length) : Vec3(0);
  e.area = static_cast<float>(0.5 * length);
}

void Scene::appendEmitters(uint32_t meshIndex, uint32_t instance) {
  const TriangleMesh& mesh = data_.meshes[meshIndex];
  const Material& material = data_.materials[mesh.material];
  const Mat4 toWorld = instance == kNoInstance ? Mat4(1) : instances_[instance].toWorld;
  const bool mirrored = glm::determinant(Mat3(toWorld)) < 0;
  const bool moves = mesh.moves() || (instance != kNoInstance && instances_[instance].motion != GroupInstance::kStill);
  const size_t first = emitters_.size();
  emitters_.resize(first + mesh.triangles.size());
  parallelChunks(mesh.triangles.size(), 1024, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const glm::uvec3& index = mesh.triangles[t];
      EmissiveTriangle& e = emitters_[first + t];
      Vec3 corners[3];
      for (int k = 0; k < 3; ++k) corners[k] = Vec3(toWorld * Vec4(mesh.positions[index[k]], 1));
      setShape(e, corners, mirrored);
      e.mesh = meshIndex;
      e.triangle = static_cast<uint32_t>(t);
      e.instance = instance;
      e.twoSided = material.doubleSided;
      e.textured = bool(material.emissiveTexture) || material.alphaMode != AlphaMode::Opaque;
      e.moves = moves;
      if (moves) averageOverSteps(e);
      e.meanRadiance = material.emission;
      if (e.textured) {
        // Centroid-like lattice of 28 points; only guides sampling, so a coarse mean is enough.
        Spectrum sum(0);
        for (int i = 0; i < 7; ++i)
          for (int j = 0; j < 7 - i; ++j)
            sum += coveredEmission(mesh, e.triangle, (static_cast<float>(i) + 0.33f) / 7,
                                   (static_cast<float>(j) + 0.33f) / 7);
        e.meanRadiance = sum / 28.0f;
      }
      if (e.area == 0) e.meanRadiance = Spectrum(0);
    }
  });
}

void Scene::collectEmitters() {
  const auto emits = [&](uint32_t m) {
    const Material& material = data_.materials[data_.meshes[m].material];
    return material.emissive() && !material.unlit;
  };
  meshEmitterBase_.assign(data_.meshes.size(), -1);
  for (uint32_t m : worldMeshes_) {
    if (!emits(m)) continue;
    meshEmitterBase_[m] = static_cast<int64_t>(emitters_.size());
    appendEmitters(m, kNoInstance);
  }
  instanceEmitterBase_.resize(instances_.size());
  for (size_t i = 0; i < instances_.size(); ++i) {
    const MeshGroup& group = groups_[instances_[i].group];
    if (std::none_of(group.meshes.begin(), group.meshes.end(), emits)) continue;
    instanceEmitterBase_[i].assign(group.meshes.size(), -1);
    for (size_t k = 0; k < group.meshes.size(); ++k) {
      if (!emits(group.meshes[k])) continue;
      instanceEmitterBase_[i][k] = static_cast<int64_t>(emitters_.size());
      appendEmitters(group.meshes[k], static_cast<uint32_t>(i));
    }
  }
}

int64_t Scene::emitterIndex(uint32_t mesh, uint32_t triangle, uint32_t instance) const {
  int64_t base = -1;
  if (instance == kNoInstance) {
    base = meshEmitterBase_[mesh];
  } else if (!instanceEmitterBase_[instance].empty()) {
    const std::vector<uint32_t>& meshes = groups_[instances_[instance].group].meshes;
    const auto k = static_cast<size_t>(std::find(meshes.begin(), meshes.end(), mesh) - meshes.begin());
    base = instanceEmitterBase_[instance][k];
  }
  return base < 0 ? -1 : base + triangle;
}

Vec4 Scene::lookup(const TextureRef& ref, const TriangleMesh& mesh, uint32_t triangle, float u, float v) const {
  const std::vector<Vec2>& uv = mesh.uv[ref.uvSet];
  // A mesh without the coordinates a material asks for reads texel (0, 0).
  const Vec2 at = uv.empty() ? Vec2(0) : interpolate(uv, mesh.triangles[triangle], u, v);
  return data_.textures[static_cast<size_t>(ref.texture)].sample(ref.apply(at));
}

Spectrum Scene::emission(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const {
  const Material& m = material(mesh);
  return m.emissiveTexture ? m.emission * Spectrum(lookup(m.emissiveTexture, mesh, triangle, u, v)) : m.emission;
}

Spectrum Scene::coveredEmission(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const {
  return emission(mesh, triangle, u, v) * alpha(mesh, triangle, u, v);
}

float Scene::alpha(const TriangleMesh& mesh, uint32_t triangle, float u, float v) const {
  const Material& m = material(mesh);
  if (m.alphaMode == AlphaMode::Opaque) return 1;
  float a = m.alpha;
  if (m.baseColorTexture) a *= lookup(m.baseColorTexture, mesh, triangle, u, v).a;
  if (!mesh.colors.empty()) a *= interpolate(mesh.colors, mesh.triangles[triangle], u, v).a;
  if (m.alphaMode == AlphaMode::Mask) return a >= m.alphaCutoff ? 1.0f : 0.0f;
  return std::clamp(a, 0.0f, 1.0f);
}

float Scene::passing(uint32_t meshIndex, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const {
  const TriangleMesh& m = data_.meshes[meshIndex];
  const Material& mat = material(m);
  // TRAP: culling is one-way, so it must not take part in transport: light that passes a wall from behind could not be
  // traced from the light, which meets the wall's front.
  if (backFace && (salt & kCameraRay) && !mat.doubleSided && !mat.transmissive() && mat.diffuseTransmission == 0)
    return 1;
  return mat.alphaMode == AlphaMode::Opaque ? 0 : 1 - alpha(m, triangle, u, v);
}

bool Scene::passThrough(uint32_t meshIndex, uint32_t triangle, float u, float v, bool backFace, uint32_t salt) const {
  const float share = passing(meshIndex, triangle, u, v, backFace, salt);
  if (share >= 1) return true;
  if (share <= 0) return false;
  // Coverage decided once per ray and triangle: the same answer if Embree asks twice.
  const uint32_t h = mix32(mix32((salt & ~kCameraRay) ^ (meshIndex * 0x9e3779b9u)) ^ triangle);
  return static_cast<float>(h >> 8) * 0x1p-24f >= 1 - share;
}

size_t Scene::textureBytes() const {
  size_t bytes = environment_ ? environment_->bytes() : 0;
  std::map<const Image*, size_t> images;
  for (const Texture& t : data_.textures)
    if (t.sharedImage()) images[t.sharedImage().get()] = t.bytes();
  for (const auto& [image, size] : images) bytes += size;
  return bytes;
}

}  // namespace braid
