// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/gltf_nodes.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"
#include "renderer/scene/data/placement.h"
#include "renderer/scene/gltf/gltf_variants.h"

namespace braid::gltf {

namespace {

std::string nodePlace(int node) { return "/nodes/" + std::to_string(node); }

// Embree ends the program at rays and transforms beyond 1.8e18: places keep away from that, as vertices do.
bool isWithinReach(const glm::dmat4& m) {
  const double* v = glm::value_ptr(m);
  return std::all_of(v, v + 16, [](double x) { return std::abs(x) < 1e17; });
}

// What makes two uses of a primitive the same triangles.
struct MeshKey {
  const Primitive* primitive;
  int skin;
  std::vector<float> weights;
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
      : document_(document),
        options_(options),
        materials_(materials),
        scene_(scene),
        pose_(makePose(document, options)) {
    variant_ = chosenVariant(document_, options_.variant);
    skins_.resize(document.model.skins.size());
  }

  void build() {
    for (const int node : nodesOfScene()) {
      addCamera(node);
      if (!pose_.visible[static_cast<size_t>(node)]) continue;
      addLight(node);
      if (nodeAt(node).mesh >= 0) addMesh(node);
    }
    buildMeshes();
    placeAll();
    useCamera();
  }

 private:
  const tinygltf::Node& nodeAt(int node) const { return document_.model.nodes[static_cast<size_t>(node)]; }

  std::vector<int> rootsOfScene() {
    const std::vector<tinygltf::Scene>& scenes = document_.model.scenes;
    if (options_.scene && (*options_.scene < 0 || static_cast<size_t>(*options_.scene) >= scenes.size())) {
      throw SceneError(ExitCode::BadInput, document_.path, "/scenes",
                       "scene " + std::to_string(*options_.scene) + " was asked for, but the file has " +
                           counted(scenes.size(), "scene", "scenes"));
    }
    const int chosen = options_.scene ? *options_.scene : std::max(document_.model.defaultScene, 0);
    document_.usage.mark("scenes", chosen);
    if (!scenes.empty()) return scenes[static_cast<size_t>(chosen)].nodes;
    document_.report.warn("", "the file has no scene; all its nodes are shown");
    std::vector<int> roots;
    for (size_t i = 0; i < document_.parents.size(); ++i) {
      if (document_.parents[i] < 0) roots.push_back(static_cast<int>(i));
    }
    return roots;
  }

  // Depth first in the order of the file.
  std::vector<int> nodesOfScene() {
    std::vector<int> order, stack = rootsOfScene();
    std::reverse(stack.begin(), stack.end());
    std::vector<bool> seen(document_.model.nodes.size(), false);
    while (!stack.empty()) {
      const int node = stack.back();
      stack.pop_back();
      if (node < 0 || seen[static_cast<size_t>(node)]) continue;
      seen[static_cast<size_t>(node)] = true;
      document_.usage.mark("nodes", node);
      order.push_back(node);
      const std::vector<int>& children = nodeAt(node).children;
      stack.insert(stack.end(), children.rbegin(), children.rend());
    }
    return order;
  }

  void addCamera(int index) {
    const tinygltf::Node& node = nodeAt(index);
    if (node.camera < 0) return;
    CameraData camera = document_.cameras[static_cast<size_t>(node.camera)];
    if (!node.name.empty()) camera.name = node.name;
    if (camera.name.empty()) camera.name = "camera " + std::to_string(scene_.cameras.size());
    // Scale does not apply to cameras: only where the node stands, its backward axis and which way is up.
    const glm::dmat4& world = pose_.world[static_cast<size_t>(index)];
    const glm::dmat3 axes = axesOf(world);
    const glm::dvec3 back = axes[2], up = axes[1];
    const glm::dvec3 side = glm::cross(up, back);
    if (!(glm::length(side) > 1e-30) || !isWithinReach(world)) {
      document_.report.warn(nodePlace(index),
                            "a camera's node has a singular or endless transform; the camera is left out");
      return;
    }
    const glm::dvec3 z = glm::normalize(back), x = glm::normalize(side);
    cameras_.emplace_back(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), world[3]);
    scene_.cameras.push_back(std::move(camera));
    cameraOf_.push_back(node.camera);
  }

  // Flaws matter only in the camera that looks.
  void useCamera() {
    for (size_t i = 0; i < cameraOf_.size(); ++i) {
      const std::string& wanted = options_.camera;
      if (wanted.empty() ? i == 0 : scene_.cameras[i].name == wanted || std::to_string(i) == wanted)
        document_.usage.mark("cameras", cameraOf_[i]);
    }
  }

  void addLight(int index) {
    const tinygltf::Node& node = nodeAt(index);
    const int source = gltf::index(member(node.extensions, "KHR_lights_punctual"), "light");
    if (source < 0) return;
    document_.usage.mark("lights", source);
    PunctualLight light = document_.lights[static_cast<size_t>(source)];
    if (!node.name.empty()) light.name = node.name;
    const glm::dmat4& world = pose_.world[static_cast<size_t>(index)];
    const bool isPoint = light.kind == PunctualKind::Point;
    const glm::dvec3 direction = isPoint ? glm::dvec3(0, 0, -1) : -axesOf(world)[2];
    if (!(glm::length(direction) > 1e-30) || !isWithinReach(world)) {
      document_.report.warn(nodePlace(index),
                            "a light's node has a singular or endless transform; the light is left out");
      return;
    }
    lights_.emplace_back(world[3]);
    light.direction = Vec3(glm::normalize(direction));
    scene_.lights.push_back(std::move(light));
  }

  void addMesh(int index) {
    const tinygltf::Node& node = nodeAt(index);
    document_.usage.mark("meshes", node.mesh);
    std::vector<glm::dmat4> placed;
    if (firstMesh_ < 0) firstMesh_ = index;
    document_.usage.mark("skins", node.skin);
    // Without joints the mesh stays where its node is.
    const int skin =
        node.skin >= 0 && !document_.model.skins[static_cast<size_t>(node.skin)].joints.empty() ? node.skin : -1;
    if (skin >= 0) {
      placed.emplace_back(1);
    } else {
      const Attributes instancing = instancingOf(node);
      for (const auto& [name, accessor] : instancing) document_.useAccessor(accessor);
      budget(2 * instanceCount(document_, instancing) * sizeof(glm::dmat4));
      for (const glm::dmat4& local : instanceTransforms(document_, instancing)) {
        const glm::dmat4 toWorld = pose_.world[static_cast<size_t>(index)] * local;
        if (shapeOf(toWorld) != Shape::Gone && isWithinReach(toWorld)) {
          placed.emplace_back(toWorld);
        } else {
          document_.report.warn(
              nodePlace(index),
              "a mesh that its transform makes a line or a point (a scale of 0) or endless is left out");
        }
      }
    }
    const tinygltf::Mesh& mesh = document_.model.meshes[static_cast<size_t>(node.mesh)];
    const std::string name = mesh.name.empty() ? "mesh " + std::to_string(node.mesh) : mesh.name;
    for (size_t p = 0; !placed.empty() && p < mesh.primitives.size(); ++p) {
      MeshJob job;
      job.primitive = &mesh.primitives[p];
      job.place = "/meshes/" + std::to_string(node.mesh) + "/primitives/" + std::to_string(p);
      job.name = name + (mesh.primitives.size() > 1 ? "/" + std::to_string(p) : "");
      const uint32_t number = placeJob(std::move(job), skin, pose_.weights[static_cast<size_t>(index)]);
      budget(placed.size() * sizeof(MeshInstance));
      for (const glm::dmat4& toWorld : placed) {
        scene_.instances.push_back({number, Mat4(1)});
        transforms_.push_back(toWorld);
        // What is flattened cannot share its triangles.
        if (shapeOf(toWorld) == Shape::Flat) budget(estimatedBytes(document_, mesh.primitives[p]));
      }
    }
  }

  const Primitive* representative(const Primitive& primitive) {
    const int packed = gltf::index(member(primitive.extensions, "KHR_draco_mesh_compression"), "bufferView");
    GeometryKey key{primitive.attributes, primitive.targets,    primitive.indices, primitive.material, packed,
                    primitive.mode,       variantsOf(primitive)};
    return representatives_.emplace(std::move(key), &primitive).first->second;
  }

  uint32_t placeJob(MeshJob job, int skin, const std::vector<float>& weights) {
    const Primitive& primitive = *job.primitive;
    const bool isMorphed = !primitive.targets.empty();
    MeshKey key{representative(primitive), skin, isMorphed ? weights : std::vector<float>()};
    const auto [entry, isNew] = jobIndex_.emplace(std::move(key), static_cast<uint32_t>(jobs_.size()));
    if (!isNew) return entry->second;
    budget(estimatedBytes(document_, primitive));
    useData(primitive);
    job.material = materials_.use(materialOf(primitive));
    job.uvs = materials_.uvs(job.material);
    job.needsTangents = scene_.materials[job.material].needsTangents();
    job.keepAllAttributes = options_.keepAllAttributes;
    job.weights = entry->first.weights;
    if (skin >= 0) job.joints = jointsOf(skin);
    jobs_.push_back(std::move(job));
    return entry->second;
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

  std::shared_ptr<const std::vector<glm::dmat4>> jointsOf(int skin) {
    std::shared_ptr<const std::vector<glm::dmat4>>& joints = skins_[static_cast<size_t>(skin)];
    const tinygltf::Skin& source = document_.model.skins[static_cast<size_t>(skin)];
    if (!joints) joints = std::make_shared<const std::vector<glm::dmat4>>(jointMatrices(document_, pose_, source));
    document_.useAccessor(source.inverseBindMatrices);
    return joints;
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
    std::vector<TriangleMesh> built(jobs_.size());
    std::vector<Report> reports(jobs_.size());
    parallelFor(jobs_.size(), [&](size_t i) { built[i] = buildMesh(document_, jobs_[i], reports[i]); });
    for (const Report& report : reports) document_.report.append(report);
    // Points, lines and empty primitives leave no mesh.
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
      transforms_[kept++] = transforms_[i];
    }
    scene_.instances.resize(kept);
    transforms_.resize(kept);
  }

  // Up to here everything stands in the file's coordinates, as doubles.
  void placeAll() {
    glm::dvec3 root(0);
    if (firstMesh_ >= 0) {
      auto node = static_cast<size_t>(firstMesh_);
      while (document_.parents[node] >= 0) node = static_cast<size_t>(document_.parents[node]);
      root = glm::dvec3(pose_.world[node][3]);
    }
    scene_.origin = originFor(scene_, transforms_, root);
    if (scene_.origin != glm::dvec3(0)) {
      skinAnew();
      bringVerticesNear(scene_, transforms_, scene_.origin);
    }
    for (size_t i = 0; i < transforms_.size(); ++i)
      scene_.instances[i].toWorld = relativeTo(transforms_[i], scene_.origin);
    for (size_t i = 0; i < cameras_.size(); ++i) scene_.cameras[i].toWorld = relativeTo(cameras_[i], scene_.origin);
    for (size_t i = 0; i < lights_.size(); ++i) scene_.lights[i].position = Vec3(lights_[i] - scene_.origin);
  }

  // Skinned vertices are in the world already: they are computed again about the origin.
  void skinAnew() {
    parallelFor(scene_.meshes.size(), [&](size_t m) {
      MeshJob& job = jobs_[jobOf_[m]];
      if (!job.joints) return;
      job.origin = scene_.origin;
      Report told;
      scene_.meshes[m] = buildMesh(document_, job, told);
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
  Pose pose_;
  int variant_ = -1;
  uint64_t spent_ = 0;
  int firstMesh_ = -1;                            // the first node that shows one
  std::vector<glm::dmat4> transforms_, cameras_;  // of scene_.instances and scene_.cameras
  std::vector<glm::dvec3> lights_;                // positions of scene_.lights
  std::vector<size_t> jobOf_;                     // of scene_.meshes
  std::vector<int> cameraOf_;                     // of the file, behind those of the scene
  std::vector<std::shared_ptr<const std::vector<glm::dmat4>>> skins_;
  std::map<GeometryKey, const Primitive*> representatives_;
  std::map<MeshKey, uint32_t> jobIndex_;
  std::vector<MeshJob> jobs_;
};

}  // namespace

void buildScene(Document& document, const LoadOptions& options, MaterialTable& materials, SceneData& scene) {
  SceneBuilder(document, options, materials, scene).build();
}

}  // namespace braid::gltf
