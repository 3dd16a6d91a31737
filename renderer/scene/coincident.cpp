// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/coincident.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>

#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// A plane as unit normal and distance from zero, in units of cells that are far wider than rounding errors of planes of
// one triangle, or of large ones.
using Plane = std::array<double, 4>;
constexpr double kNormalCells = 1024, kDistanceCells = 65536;
// A value so near to the next cell might have been rounded into it.
constexpr double kNextCell = 0.5 - 1.0 / 32;

uint64_t keyOf(const std::array<int64_t, 4>& cell) {
  uint64_t key = 0;
  for (const int64_t c : cell) key = hashCombine(key, static_cast<uint64_t>(c));
  return key;
}

uint64_t keyOf(const Plane& plane) {
  std::array<int64_t, 4> cell;
  for (size_t i = 0; i < 4; ++i) cell[i] = std::llround(plane[i]);
  return keyOf(cell);
}

Plane opposite(const Plane& p) { return {-p[0], -p[1], -p[2], -p[3]}; }

// Calls found(key) for the cell of a plane and for those that it might have been rounded into; whether any call did.
template <class Found>
bool anyCell(const Plane& plane, const Found& found) {
  std::array<int64_t, 4> nearest, other;
  for (size_t i = 0; i < 4; ++i) {
    nearest[i] = std::llround(plane[i]);
    const double off = plane[i] - static_cast<double>(nearest[i]);
    other[i] = nearest[i] + (off > kNextCell ? 1 : off < -kNextCell ? -1 : 0);
  }
  for (unsigned choice = 0; choice < 16; ++choice) {
    std::array<int64_t, 4> cell = nearest;
    bool isNew = true;
    for (size_t i = 0; i < 4; ++i) {
      if (!(choice >> i & 1)) continue;
      isNew = isNew && other[i] != nearest[i];
      cell[i] = other[i];
    }
    if (isNew && found(keyOf(cell))) return true;
  }
  return false;
}

// A set of keys that may claim to hold others, one in a hundred.
class KeyFilter {
 public:
  explicit KeyFilter(uint64_t keys) : bits_(std::bit_ceil(std::max<uint64_t>(16 * keys, 64))), words_(bits_ / 64) {}
  void insert(uint64_t key) {
    for (const uint64_t bit : {key & (bits_ - 1), (key >> 32) & (bits_ - 1)})
      words_[bit / 64].fetch_or(uint64_t(1) << (bit % 64), std::memory_order_relaxed);
  }
  bool mayHold(uint64_t key) const {
    for (const uint64_t bit : {key & (bits_ - 1), (key >> 32) & (bits_ - 1)})
      if (!(words_[bit / 64].load(std::memory_order_relaxed) >> (bit % 64) & 1)) return false;
    return true;
  }

 private:
  uint64_t bits_;
  std::vector<std::atomic<uint64_t>> words_;
};

// Unit normal on the front of a triangle; 0 if it has no area.
glm::dvec3 normalOf(const Vec3* p, bool mirrored) {
  const glm::dvec3 n = glm::cross(glm::dvec3(p[1]) - glm::dvec3(p[0]), glm::dvec3(p[2]) - glm::dvec3(p[0]));
  const double length = glm::length(n);
  return length > 0 && std::isfinite(length) ? n * ((mirrored ? -1 : 1) / length) : glm::dvec3(0);
}

float largestOf(const Vec3& v) { return maxComponent(magnitudes(v)); }

}  // namespace

CoincidentFaces::CoincidentFaces(const AccelInput& input, const std::vector<uint8_t>& reachable,
                                 const std::vector<uint8_t>& opaque)
    : meshes_(*input.meshes),
      instances_(*input.instances),
      reachable_(reachable),
      opaque_(opaque),
      suspect_(meshes_.size()) {
  uint64_t repeated = 0;
  for (const GroupInstance& i : instances_)
    for (const uint32_t m : (*input.groups)[i.group].meshes) repeated += meshes_[m].triangles.size();
  std::vector<Placed> world;
  for (const uint32_t m : *input.worldMeshes) world.push_back({m, kNoInstance});
  for (uint32_t i = 0; repeated <= kMostPlaced && i < instances_.size(); ++i)
    for (const uint32_t m : (*input.groups)[instances_[i].group].meshes) world.push_back({m, i});
  look(world);
}

void CoincidentFaces::look(const std::vector<Placed>& placed) {
  uint64_t candidates = 0;
  float largest = 0;
  for (const Placed& p : placed) {
    if (!opaque_[p.mesh]) continue;
    if (reachable_[p.mesh]) candidates += meshes_[p.mesh].triangles.size();
    for (const Vec3& v : meshes_[p.mesh].positions)
      largest = std::max(largest,
                         largestOf(p.instance == kNoInstance ? v : Vec3(instances_[p.instance].toWorld * Vec4(v, 1))));
  }
  if (candidates == 0 || !(largest > 0)) return;

  // Calls visit(triangle, plane) for all opaque triangles with an area.
  const auto forEach = [&](const Placed& p, const auto& visit) {
    parallelChunks(meshes_[p.mesh].triangles.size(), 4096, [&](size_t begin, size_t end) {
      for (size_t t = begin; t < end; ++t) {
        const Triangle triangle = triangleOf(p.mesh, static_cast<uint32_t>(t), p.instance);
        const glm::dvec3 unit = normalOf(triangle.p, triangle.mirrored);
        if (!(glm::dot(unit, unit) > 0.5)) continue;
        const double distance = glm::dot(unit, glm::dvec3(triangle.p[0])) / static_cast<double>(largest);
        visit(t, Plane{unit.x * kNormalCells, unit.y * kNormalCells, unit.z * kNormalCells, distance * kDistanceCells});
      }
    });
  };

  KeyFilter fronts(candidates);
  for (const Placed& p : placed)
    if (opaque_[p.mesh] && reachable_[p.mesh])
      forEach(p, [&](size_t, const Plane& plane) { fronts.insert(keyOf(plane)); });
  std::vector<uint64_t> backs;
  std::vector<Face> found;
  std::mutex mutex;
  for (const Placed& p : placed) {
    if (!opaque_[p.mesh]) continue;
    forEach(p, [&](size_t t, const Plane& plane) {
      if (!anyCell(opposite(plane), [&](uint64_t key) { return fronts.mayHold(key); })) return;
      const std::lock_guard lock(mutex);
      backs.push_back(keyOf(plane));
      found.push_back({p.mesh, static_cast<uint32_t>(t), p.instance, false});
    });
  }
  std::sort(backs.begin(), backs.end());
  backs.erase(std::unique(backs.begin(), backs.end()), backs.end());
  bool any = false;
  for (const Placed& p : placed) {
    if (backs.empty() || !opaque_[p.mesh] || !reachable_[p.mesh]) continue;
    std::vector<bool>& suspect = suspect_[p.mesh];
    forEach(p, [&](size_t t, const Plane& plane) {
      const auto isBack = [&](uint64_t key) { return std::binary_search(backs.begin(), backs.end(), key); };
      if (!anyCell(opposite(plane), isBack)) return;
      const std::lock_guard lock(mutex);
      suspect.resize(meshes_[p.mesh].triangles.size());
      suspect[t] = true;
      any = true;
    });
  }
  if (any) faces_ = std::move(found);
  std::sort(faces_.begin(), faces_.end());  // the order of threads must not show
  corners_.reserve(3 * faces_.size() + 1);  // Embree loads 16 bytes a vertex
  triangles_.reserve(faces_.size() + 1);
  for (Face& face : faces_) {
    const auto first = static_cast<uint32_t>(corners_.size());
    const Triangle triangle = triangleOf(face.mesh, face.triangle, face.instance);
    corners_.insert(corners_.end(), triangle.p, triangle.p + 3);
    triangles_.push_back({first, first + 1, first + 2});
    face.mirrored = triangle.mirrored;
  }
}

CoincidentFaces::Triangle CoincidentFaces::triangleOf(uint32_t meshIndex, uint32_t number, uint32_t instance) const {
  const TriangleMesh& mesh = meshes_[meshIndex];
  const glm::uvec3& index = mesh.triangles[number];
  Triangle triangle{{mesh.positions[index.x], mesh.positions[index.y], mesh.positions[index.z]}, false};
  if (instance == kNoInstance) return triangle;
  const Mat4& toWorld = instances_[instance].toWorld;
  for (Vec3& p : triangle.p) p = Vec3(toWorld * Vec4(p, 1));
  triangle.mirrored = glm::determinant(Mat3(toWorld)) < 0;
  return triangle;
}

float CoincidentFaces::reach(const RayQuery& ray, const RayHit& hit) const {
  const std::vector<bool>& suspect = suspect_[hit.mesh];
  if (suspect.empty() || !suspect[hit.triangle]) return 0;
  const Triangle triangle = triangleOf(hit);
  const double away = glm::dot(glm::dvec3(ray.direction), normalOf(triangle.p, triangle.mirrored));
  if (!(away > 0)) return 0;
  // Either plane's distance from the ray's origin is a dot product of differences of coordinates: some eight rounded
  // operations on the largest of them, and as many again where an instance is transformed.
  constexpr double kRounding = 32 * 0.5 * static_cast<double>(std::numeric_limits<float>::epsilon());
  float largest = largestOf(ray.origin);
  for (const Vec3& p : triangle.p) largest = std::max(largest, largestOf(p));
  if (hit.instance != kNoInstance) {
    // Embree meets an instance in its own coordinates: what its transform multiplies and adds is rounded as well.
    const GroupInstance& instance = instances_[hit.instance];
    const Mat3 linear(instance.toWorld);
    const glm::uvec3& index = meshes_[hit.mesh].triangles[hit.triangle];
    float local = 0;
    for (int k = 0; k < 3; ++k) local = std::max(local, largestOf(meshes_[hit.mesh].positions[index[k]]));
    largest += local * (largestOf(linear[0]) + largestOf(linear[1]) + largestOf(linear[2])) +
               largestOf(Vec3(instance.toWorld[3]));
  }
  return static_cast<float>(kRounding * static_cast<double>(largest) / away);
}

bool CoincidentFaces::pairs(const RayHit& back, const RayHit& found) const {
  if (!opaque_[found.mesh]) return false;
  const Triangle a = triangleOf(back), b = triangleOf(found);
  return glm::dot(normalOf(a.p, a.mirrored), normalOf(b.p, b.mirrored)) < -0.999;
}

}  // namespace braid
