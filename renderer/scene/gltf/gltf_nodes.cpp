// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/gltf_nodes.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"
#include "renderer/scene/data/placement.h"
#include "renderer/scene/gltf/poses/gltf_cameras_lights.h"
#include "renderer/scene/gltf/poses/gltf_motion.h"
#include "renderer/scene/gltf/poses/gltf_scene_nodes.h"
#include "renderer/scene/gltf/gltf_variants.h"

namespace braid::gltf {

namespace {

// What makes two uses of a primitive the same triangles.
struct MeshKey {
  const Primitive* primitive;
  int skin;
  std::vector<float> weights;
  std::array<double, 9> frame{};  // RoundShape::toWorld of points and lines
  auto operator<=>(const MeshKey&) const = default;
};

// What two primitives of the file must share to be the same triangles.
struct GeometryKey {
  Attributes attributes;
  std::vector<Attributes> targets;
  int indices, material, draco, mode;
  std::vector<std::pair<int, int>> variants;
  auto operator<=>(const GeometryKey&) const = default;
};

class SceneBuilder {
 public:
  SceneBuilder(Document& document, const LoadOptions& options, MaterialTable& materials, SceneData& scene)
      : document_(document), options_(options), materials_(materials), scene_(scene), views_(document, scene) {
    variant_ = chosenVariant(document_, options_.variant);
    skins_.resize(document.model.skins.size());
  }

  void build() {
    const std::vector<int> nodes = nodesOfScene(document_, options_);
    poses_ = posesWhileOpen(document_, options_, nodesThatShow(document_, options_, nodes));
    scene_.motion = poses_.motion;
    for (const int node : nodes) {
      views_.addCamera(node, poses_);
      if (!poses_.first.visible[static_cast<size_t>(node)]) {
        document_.count(FilePart::HiddenNodes);
        continue;
      }
      views_.addLight(node, poses_);
      if (nodeAt(node).mesh >= 0) addMesh(node);
    }
    buildMeshes();
    placeAll();
  }

 private:
  const tinygltf::Node& nodeAt(int node) const { return document_.model.nodes[static_cast<size_t>(node)]; }

  void addMesh(int index) {
    const tinygltf::Node& node = nodeAt(index);
    document_.usage.mark("meshes", node.mesh);
    if (firstMesh_ < 0) firstMesh_ = index;
    document_.usage.mark("skins", node.skin);
    // Without joints the mesh stays where its node is.
    const int skin =
        node.skin >= 0 && !document_.model.skins[static_cast<size_t>(node.skin)].joints.empty() ? node.skin : -1;
    const std::vector<Track> placed = skin >= 0 ? std::vector<Track>{{glm::dmat4(1)}} : placesOf(index);
    const tinygltf::Mesh& mesh = document_.model.meshes[static_cast<size_t>(node.mesh)];
    const std::string name = mesh.name.empty() ? "mesh " + std::to_string(node.mesh) : mesh.name;
    for (size_t p = 0; !placed.empty() && p < mesh.primitives.size(); ++p) {
      MeshJob job;
      job.primitive = &mesh.primitives[p];
      job.place = "/meshes/" + std::to_string(node.mesh) + "/primitives/" + std::to_string(p);
      job.name = name + (mesh.primitives.size() > 1 ? "/" + std::to_string(p) : "");
      const bool isRound = options_.pointRadius > 0 && job.primitive->mode < 4;
      budget(placed.size() * placed.front().size() * sizeof(MeshInstance));
      uint32_t number = kNone;
      for (const Track& track : placed) {
        // Points and lines are as thick as they are in the world, however a node scales them.
        if (isRound) job.round.toWorld = roundFrame(glm::dmat3(track.front()));
        if (isRound || number == kNone) number = placeJob(job, skin, index);
        scene_.instances.push_back({number, Mat4(1), {}});
        transforms_.push_back(track.front());
        steps_.emplace_back(track.begin() + 1, track.end());
        // What is flattened cannot share its triangles, nor what changes its shape while it moves.
        const bool solid =
            std::all_of(track.begin(), track.end(), [](const glm::dmat4& m) { return shapeOf(m) == Shape::Solid; });
        if (!solid || (track.size() > 1 && !jobs_[number].later.empty()))
          budget(track.size() * estimatedBytes(document_, mesh.primitives[p]));
      }
    }
  }

  // Transforms to the world at all steps, or at the one of what stands still.
  using Track = std::vector<glm::dmat4>;

  // Where a node has its mesh, but for places in which there is nothing to be seen.
  std::vector<Track> placesOf(int index) {
    const Attributes instancing = instancingOf(nodeAt(index));
    for (const auto& [attribute, accessor] : instancing) document_.useAccessor(accessor);
    const size_t steps = poses_.moved(index) ? poses_.later.size() + 1 : 1;
    budget((1 + steps) * instanceCount(document_, instancing) * sizeof(glm::dmat4));
    std::vector<Track> places;
    for (const glm::dmat4& local : instanceTransforms(document_, instancing)) {
      Track track;
      for (size_t k = 0; k < steps; ++k) track.push_back(poses_.step(k).world[static_cast<size_t>(index)] * local);
      const bool seen =
          std::any_of(track.begin(), track.end(), [](const glm::dmat4& m) { return shapeOf(m) != Shape::Gone; });
      if (seen && std::all_of(track.begin(), track.end(), isWithinReach)) {
        places.push_back(std::move(track));
      } else {
        document_.report.warn(
            nodePlace(index),
            "a mesh that its transform makes a line or a point (a scale of 0) or endless is left out");
      }
    }
    return places;
  }

  const Primitive* representative(const Primitive& primitive) {
    const int packed = gltf::index(member(primitive.extensions, "KHR_draco_mesh_compression"), "bufferView");
    GeometryKey key{primitive.attributes, primitive.targets,    primitive.indices, primitive.material, packed,
                    primitive.mode,       variantsOf(primitive)};
    return representatives_.emplace(std::move(key), &primitive).first->second;
  }

  uint32_t placeJob(MeshJob job, int skin, int node) {
    const Primitive& primitive = *job.primitive;
    const auto i = static_cast<size_t>(node);
    const bool morphs = !primitive.targets.empty() && poses_.morphed(node);
    MeshKey key{representative(primitive), skin, {}, {}};
    const double* frame = glm::value_ptr(job.round.toWorld);
    std::copy(frame, frame + 9, key.frame.begin());
    if (!primitive.targets.empty()) key.weights = job.weights = poses_.first.weights[i];
    for (size_t k = 0; morphs && k < poses_.later.size(); ++k) {
      const std::vector<float>& weights = poses_.later[k].weights[i];
      key.weights.insert(key.weights.end(), weights.begin(), weights.end());
    }
    const auto [entry, isNew] = jobIndex_.emplace(std::move(key), static_cast<uint32_t>(jobs_.size()));
    if (!isNew) return entry->second;
    const bool changes = morphs || (skin >= 0 && moves(document_.model.skins[static_cast<size_t>(skin)]));
    if (skin >= 0) job.joints = jointsOf(skin, 0);
    for (size_t k = 1; changes && k <= poses_.later.size(); ++k)
      job.later.push_back(
          {morphs ? poses_.later[k - 1].weights[i] : job.weights, skin >= 0 ? jointsOf(skin, k) : nullptr});
    budget((1 + job.later.size()) * estimatedBytes(document_, primitive));
    if (isPacked(primitive)) document_.count(FilePart::DracoPrimitives);
    if (primitive.mode < 4 && options_.pointRadius > 0) document_.count(FilePart::RoundPrimitives);
    useData(primitive);
    job.material = materials_.use(materialOf(primitive));
    job.uvs = materials_.uvs(job.material);
    job.round.radius = options_.pointRadius;
    job.needsTangents = scene_.materials[job.material].needsTangents();
    job.keepAllAttributes = options_.keepAllAttributes;
    jobs_.push_back(std::move(job));
    return entry->second;
  }

  bool moves(const tinygltf::Skin& skin) const {
    return std::any_of(skin.joints.begin(), skin.joints.end(),
                       [&](int joint) { return joint >= 0 && poses_.moved(joint); });
  }

  void useData(const Primitive& primitive) {
    for (const auto& [name, accessor] : primitive.attributes) document_.useAccessor(accessor);
    for (const auto& target : primitive.targets) {
      for (const auto& [name, accessor] : target) document_.useAccessor(accessor);
    }
    if (const auto found = document_.unreadable.find(&primitive); found != document_.unreadable.end()) {
      for (const int accessor : found->second) document_.useAccessor(accessor);
    }
    document_.useAccessor(primitive.indices);
    document_.useView(gltf::index(member(primitive.extensions, "KHR_draco_mesh_compression"), "bufferView"));
  }

  int materialOf(const Primitive& primitive) const {
    for (const auto& [variant, material] : variantsOf(primitive)) {
      if (variant == variant_ && variant_ >= 0) return material;
    }
    return primitive.material;
  }

  std::shared_ptr<const std::vector<glm::dmat4>> jointsOf(int skin, size_t step) {
    auto& steps = skins_[static_cast<size_t>(skin)];
    steps.resize(poses_.later.size() + 1);
    const tinygltf::Skin& source = document_.model.skins[static_cast<size_t>(skin)];
    if (!steps[step])
      steps[step] =
          std::make_shared<const std::vector<glm::dmat4>>(jointMatrices(document_, poses_.step(step), source));
    document_.useAccessor(source.inverseBindMatrices);
    return steps[step];
  }

  // A few bytes of JSON can ask for the same data over and over; real files stay far below this.
  void budget(uint64_t bytes) {
    constexpr uint64_t kAlways = uint64_t(1) << 30, kTimesSource = 64;
    spent_ += bytes;
    if (spent_ <= kAlways + kTimesSource * document_.sourceBytes) return;
    throw SceneError(ExitCode::BadInput, document_.path, "/nodes",
                     "the scene repeats its data until it takes more than " + std::to_string(kTimesSource) +
                         " times the size of the file; share meshes between nodes instead of repeating primitives");
  }

  void buildMeshes() {
    const int level = roundLevel(document_, jobs_);
    for (MeshJob& job : jobs_) job.round.level = level;
    std::vector<TriangleMesh> built(jobs_.size());
    std::vector<Report> reports(jobs_.size());
    parallelFor(jobs_.size(), [&](size_t i) { built[i] = buildMovingMesh(document_, jobs_[i], reports[i]); });
    for (const Report& report : reports) document_.report.append(report);
    // Empty primitives leave no mesh.
    std::vector<uint32_t> placed(jobs_.size(), kNone);
    for (size_t i = 0; i < built.size(); ++i) {
      if (built[i].triangles.empty()) continue;
      placed[i] = static_cast<uint32_t>(scene_.meshes.size());
      scene_.meshes.push_back(std::move(built[i]));
      jobOf_.push_back(i);
    }
    size_t kept = 0;
    for (size_t i = 0; i < scene_.instances.size(); ++i) {
      const uint32_t mesh = placed[scene_.instances[i].mesh];
      if (mesh == kNone) continue;
      scene_.instances[kept].mesh = mesh;
      std::swap(steps_[kept], steps_[i]);
      transforms_[kept++] = transforms_[i];
    }
    scene_.instances.resize(kept);
    transforms_.resize(kept);
    steps_.resize(kept);
  }

  // Up to here everything stands in the file's coordinates, as doubles.
  void placeAll() {
    glm::dvec3 root(0);
    if (firstMesh_ >= 0) {
      auto node = static_cast<size_t>(firstMesh_);
      while (document_.parents[node] >= 0) node = static_cast<size_t>(document_.parents[node]);
      root = glm::dvec3(poses_.first.world[node][3]);
    }
    scene_.origin = originFor(scene_, transforms_, root);
    if (scene_.origin != glm::dvec3(0)) {
      skinAnew();
      bringVerticesNear(scene_, transforms_, steps_, scene_.origin);
    }
    for (size_t i = 0; i < transforms_.size(); ++i) {
      scene_.instances[i].toWorld = relativeTo(transforms_[i], scene_.origin);
      for (const glm::dmat4& step : steps_[i]) scene_.instances[i].steps.push_back(relativeTo(step, scene_.origin));
    }
    views_.place();
  }

  // Skinned vertices are in the world already: they are computed again about the origin.
  void skinAnew() {
    parallelFor(scene_.meshes.size(), [&](size_t m) {
      MeshJob& job = jobs_[jobOf_[m]];
      if (!job.joints) return;
      job.origin = scene_.origin;
      Report told;
      scene_.meshes[m] = buildMovingMesh(document_, job, told);
    });
    for (size_t i = 0; i < transforms_.size(); ++i) {
      if (jobs_[jobOf_[scene_.instances[i].mesh]].joints)
        transforms_[i] = glm::translate(transforms_[i], scene_.origin);
    }
  }

  Document& document_;
  const LoadOptions& options_;
  MaterialTable& materials_;
  SceneData& scene_;
  CamerasAndLights views_;
  PoseSequence poses_;
  int variant_ = -1;
  uint64_t spent_ = 0;
  int firstMesh_ = -1;                          // the first node that shows one
  std::vector<glm::dmat4> transforms_;          // of scene_.instances
  std::vector<std::vector<glm::dmat4>> steps_;  // the same at the later steps of those that move
  std::vector<size_t> jobOf_;                   // of scene_.meshes
  // Joint matrices of each skin at each step.
  std::vector<std::vector<std::shared_ptr<const std::vector<glm::dmat4>>>> skins_;
  std::map<GeometryKey, const Primitive*> representatives_;
  std::map<MeshKey, uint32_t> jobIndex_;
  std::vector<MeshJob> jobs_;
};

}  // namespace

void buildScene(Document& document, const LoadOptions& options, MaterialTable& materials, SceneData& scene) {
  SceneBuilder(document, options, materials, scene).build();
}

}  // namespace braid::gltf
