// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/coincident.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>
#include <optional>

#include "renderer/core/hash.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

// A plane as unit normal and distance from zero, in units of cells that are far wider than rounding errors of planes of
// one triangle, or of large ones.
using Plane = std::array<float, 4>;
constexpr double kNormalCells = 1024, kDistanceCells = 65536;
// A value so near to the next cell might have been rounded into it.
constexpr float kNextCell = 0.5f - 1.0f / 32;

using Cell = std::array<int64_t, 4>;

int64_t nearest(float x) { return static_cast<int64_t>(x < 0 ? x - 0.5f : x + 0.5f); }

uint64_t keyOf(const Cell& cell) {
  uint64_t key = 0;
  for (const int64_t c : cell) key = (key ^ static_cast<uint64_t>(c)) * 0x9e3779b97f4a7c15ull;
  return mix64(key);
}

uint64_t keyOf(const Plane& plane) {
  Cell cell;
  for (size_t i = 0; i < 4; ++i) cell[i] = nearest(plane[i]);
  return keyOf(cell);
}

Plane opposite(const Plane& p) { return {-p[0], -p[1], -p[2], -p[3]}; }

// Calls found(key) for the cell of a plane and for those that it might have been rounded into; whether any call did.
template <class Found>
bool anyCell(const Plane& plane, const Found& found) {
  Cell cell;
  std::array<int64_t, 4> step{};
  unsigned unsure = 0;
  for (size_t i = 0; i < 4; ++i) {
    cell[i] = nearest(plane[i]);
    const float off = plane[i] - static_cast<float>(cell[i]);
    if (std::abs(off) <= kNextCell) continue;
    step[i] = off > 0 ? 1 : -1;
    unsure |= 1u << i;
  }
  for (unsigned choice = unsure;; choice = (choice - 1) & unsure) {
    Cell other = cell;
    for (size_t i = 0; i < 4; ++i)
      if (choice >> i & 1) other[i] += step[i];
    if (found(keyOf(other))) return true;
    if (choice == 0) return false;
  }
}

}  // namespace

// Named, because a class that others may see holds them.
namespace coincident {

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

// A set of keys that is filled first and asked afterwards.
class KeySet {
 public:
  void add(uint64_t key) { keys_.push_back(key); }
  void finish() {
    std::sort(keys_.begin(), keys_.end());
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
    filter_.emplace(keys_.size());
    for (const uint64_t key : keys_) filter_->insert(key);
  }
  bool holds(uint64_t key) const {
    return filter_->mayHold(key) && std::binary_search(keys_.begin(), keys_.end(), key);
  }

 private:
  std::vector<uint64_t> keys_;
  std::optional<KeyFilter> filter_;
};

}  // namespace coincident

namespace {

// Unit normal on the front of a triangle; 0 if it has no area.
glm::dvec3 normalOf(const Vec3* p, bool mirrored) {
  const glm::dvec3 n = glm::cross(glm::dvec3(p[1]) - glm::dvec3(p[0]), glm::dvec3(p[2]) - glm::dvec3(p[0]));
  const double length = glm::length(n);
  return length > 0 && std::isfinite(length) ? n * ((mirrored ? -1 : 1) / length) : glm::dvec3(0);
}

Plane planeOf(const Vec3* p, bool mirrored, float largest) {
  const glm::dvec3 unit = normalOf(p, mirrored);
  if (!(glm::dot(unit, unit) > 0.5)) return {std::numeric_limits<float>::quiet_NaN()};
  const double distance = glm::dot(unit, glm::dvec3(p[0])) / static_cast<double>(largest);
  const glm::dvec3 normal = kNormalCells * unit;
  return {static_cast<float>(normal.x), static_cast<float>(normal.y), static_cast<float>(normal.z),
          static_cast<float>(kDistanceCells * distance)};
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
  for (const uint32_t m : *input.worldMeshes)
    if (!meshes_[m].moves()) world.push_back({m, kNoInstance});
  for (uint32_t i = 0; repeated <= kMostPlaced && i < instances_.size(); ++i)
    for (const uint32_t m : (*input.groups)[instances_[i].group].meshes)
      if (instances_[i].motion == GroupInstance::kStill && !meshes_[m].moves()) world.push_back({m, i});
  look(world);
}

// The planes of all opaque triangles, and the steps by which those are found that have another one behind them.
class CoincidentFaces::Search {
 public:
  Search(CoincidentFaces& faces, const std::vector<Placed>& placed) : faces_(faces), placed_(placed) {
    for (const Placed& p : placed_) {
      if (!faces_.opaque_[p.mesh]) continue;
      if (faces_.reachable_[p.mesh]) candidates_ += faces_.meshes_[p.mesh].triangles.size();
      for (const Vec3& v : faces_.meshes_[p.mesh].positions) {
        const Mat4* toWorld = p.instance == kNoInstance ? nullptr : &faces_.instances_[p.instance].toWorld;
        largest_ = std::max(largest_, largestOf(toWorld ? Vec3(*toWorld * Vec4(v, 1)) : v));
      }
    }
  }
  bool worthwhile() const { return candidates_ > 0 && largest_ > 0; }

  void run() {
    findPlanes();
    findFronts();
    const coincident::KeySet backs = markBacks();
    for (const auto& [face, plane] : fronts_)
      if (anyCell(opposite(plane), [&](uint64_t key) { return backs.holds(key); })) faces_.faces_.push_back(face);
  }

 private:
  void findPlanes() {
    planes_.resize(placed_.size());
    for (size_t i = 0; i < placed_.size(); ++i) {
      if (!faces_.opaque_[placed_[i].mesh]) continue;
      planes_[i].resize(faces_.meshes_[placed_[i].mesh].triangles.size());
      parallelChunks(planes_[i].size(), 4096, [&](size_t begin, size_t end) {
        for (size_t t = begin; t < end; ++t) {
          const Triangle triangle = faces_.triangleOf(placed_[i].mesh, static_cast<uint32_t>(t), placed_[i].instance);
          planes_[i][t] = planeOf(triangle.p, triangle.mirrored, largest_);
        }
      });
    }
  }

  // Calls visit(triangle, plane) for those of a mesh that have an area.
  template <class Visit>
  void forEach(size_t i, const Visit& visit) const {
    parallelChunks(planes_[i].size(), 4096, [&](size_t begin, size_t end) {
      for (size_t t = begin; t < end; ++t)
        if (!std::isnan(planes_[i][t][0])) visit(t, planes_[i][t]);
    });
  }

  // By a filter: of most triangles there is no other in the plane.
  void findFronts() {
    coincident::KeyFilter reachable(candidates_);
    for (size_t i = 0; i < placed_.size(); ++i)
      if (faces_.reachable_[placed_[i].mesh])
        forEach(i, [&](size_t, const Plane& plane) { reachable.insert(keyOf(plane)); });
    std::mutex mutex;
    for (size_t i = 0; i < placed_.size(); ++i) {
      forEach(i, [&](size_t t, const Plane& plane) {
        if (!anyCell(opposite(plane), [&](uint64_t key) { return reachable.mayHold(key); })) return;
        const std::lock_guard lock(mutex);
        fronts_.emplace_back(Face{placed_[i].mesh, static_cast<uint32_t>(t), placed_[i].instance, false}, plane);
      });
    }
  }

  // Marks the triangles that may have a front behind them; their planes.
  coincident::KeySet markBacks() const {
    coincident::KeySet frontKeys, backKeys;
    for (const auto& [face, plane] : fronts_) frontKeys.add(keyOf(plane));
    frontKeys.finish();
    std::mutex mutex;
    for (size_t i = 0; i < placed_.size(); ++i) {
      if (fronts_.empty() || !faces_.reachable_[placed_[i].mesh]) continue;
      std::vector<bool>& suspect = faces_.suspect_[placed_[i].mesh];
      forEach(i, [&](size_t t, const Plane& plane) {
        if (!anyCell(opposite(plane), [&](uint64_t key) { return frontKeys.holds(key); })) return;
        const std::lock_guard lock(mutex);
        suspect.resize(planes_[i].size());
        suspect[t] = true;
        backKeys.add(keyOf(plane));
      });
    }
    backKeys.finish();
    return backKeys;
  }

  CoincidentFaces& faces_;
  const std::vector<Placed>& placed_;
  uint64_t candidates_ = 0;                     // triangles of which rays may meet the back
  float largest_ = 0;                           // coordinate
  std::vector<std::vector<Plane>> planes_;      // of each placed mesh; not a number where a triangle has no area
  std::vector<std::pair<Face, Plane>> fronts_;  // may be found behind one that is reachable
};

void CoincidentFaces::look(const std::vector<Placed>& placed) {
  Search search(*this, placed);
  if (!search.worthwhile()) return;
  search.run();
  listFaces();
}

void CoincidentFaces::listFaces() {
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
  if (hit.instance != kNoInstance && instances_[hit.instance].motion != GroupInstance::kStill) return 0;
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
