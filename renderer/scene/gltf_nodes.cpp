// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf_nodes.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"
#include "renderer/scene/placement.h"

namespace braid::gltf {

namespace {

std::string nodePlace(uint32_t node) { return "/nodes/" + std::to_string(node); }

bool isFiniteMatrix(const Mat4& m) {
  const float* v = glm::value_ptr(m);
  return std::all_of(v, v + 16, [](float x) { return std::isfinite(x); });
}

// What makes two uses of a primitive the same triangles.
struct MeshKey {
  const Primitive* primitive;
  uint32_t skin;
  std::vector<float> weights;
  auto operator<=>(const MeshKey&) const = default;
};

// What two primitives of the file must share to be the same triangles.
struct GeometryKey {
  Attributes attributes;
  std::vector<Attributes> targets;
  uint32_t indices, material, draco;
  uint64_t mode;
  std::vector<std::pair<uint32_t, uint32_t>> variants;
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
    findVariant();
    skins_.resize(document.skins.size());
  }

  void build() {
    for (const uint32_t node : nodesOfScene()) {
      addCamera(node);
      if (!pose_.visible[node]) continue;
      addLight(node);
      if (document_.nodes[node].mesh != kNone) addMesh(node);
    }
    buildMeshes();
    placeAll();
  }

 private:
  void findVariant() {
    if (options_.variant.empty()) return;
    const auto found = std::find(document_.variants.begin(), document_.variants.end(), options_.variant);
    if (found != document_.variants.end()) {
      variant_ = static_cast<uint32_t>(found - document_.variants.begin());
      return;
    }
    std::string names;
    for (const std::string& name : document_.variants) names += (names.empty() ? "" : ", ") + quoted(name);
    throw SceneError(ExitCode::BadInput, document_.path, "/extensions/KHR_materials_variants/variants",
                     "variant " + quoted(options_.variant) + " does not exist; " +
                         (names.empty() ? "the file has no variants" : "the file has " + names));
  }

  std::vector<uint32_t> rootsOfScene() {
    const size_t count = document_.scenes.size();
    if (options_.scene && (*options_.scene < 0 || static_cast<size_t>(*options_.scene) >= count)) {
      throw SceneError(ExitCode::BadInput, document_.path, "/scenes",
                       "scene " + std::to_string(*options_.scene) + " was asked for, but the file has " +
                           counted(count, "scene", "scenes"));
    }
    if (options_.scene) return document_.scenes[static_cast<size_t>(*options_.scene)].nodes;
    if (document_.defaultScene != kNone) return document_.scenes[document_.defaultScene].nodes;
    if (count > 0) return document_.scenes[0].nodes;
    document_.report.warn("", "the file has no scene; all its nodes are shown");
    std::vector<uint32_t> roots;
    for (uint32_t i = 0; i < document_.nodes.size(); ++i) {
      if (document_.nodes[i].parent == kNone) roots.push_back(i);
    }
    return roots;
  }

  // Depth first in the order of the file.
  std::vector<uint32_t> nodesOfScene() {
    std::vector<uint32_t> order, stack = rootsOfScene();
    std::reverse(stack.begin(), stack.end());
    std::vector<bool> seen(document_.nodes.size(), false);
    while (!stack.empty()) {
      const uint32_t node = stack.back();
      stack.pop_back();
      if (seen[node]) continue;
      seen[node] = true;
      order.push_back(node);
      const std::vector<uint32_t>& children = document_.nodes[node].children;
      stack.insert(stack.end(), children.rbegin(), children.rend());
    }
    return order;
  }

  void addCamera(uint32_t index) {
    const Node& node = document_.nodes[index];
    if (node.camera == kNone) return;
    CameraData camera = document_.cameras[node.camera];
    if (!node.name.empty()) camera.name = node.name;
    if (camera.name.empty()) camera.name = "camera " + std::to_string(scene_.cameras.size());
    // Scale does not apply to cameras: only where the node stands, its backward axis and which way is up.
    const glm::dmat4& world = pose_.world[index];
    const glm::dmat3 axes = axesOf(world);
    const glm::dvec3 back = axes[2], up = axes[1];
    const glm::dvec3 side = glm::cross(up, back);
    if (!(glm::length(side) > 1e-30) || !isFiniteMatrix(Mat4(world))) {
      document_.report.warn(nodePlace(index), "a camera's node has a singular transform; the camera is left out");
      return;
    }
    const glm::dvec3 z = glm::normalize(back), x = glm::normalize(side);
    cameras_.emplace_back(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), world[3]);
    scene_.cameras.push_back(std::move(camera));
  }

  void addLight(uint32_t index) {
    const Node& node = document_.nodes[index];
    if (node.light == kNone) return;
    PunctualLight light = document_.lights[node.light];
    if (!node.name.empty()) light.name = node.name;
    const glm::dmat4& world = pose_.world[index];
    const bool isPoint = light.kind == PunctualKind::Point;
    const glm::dvec3 direction = isPoint ? glm::dvec3(0, 0, -1) : -axesOf(world)[2];
    if (!(glm::length(direction) > 1e-30) || !isFiniteMatrix(Mat4(world))) {
      document_.report.warn(nodePlace(index), "a light's node has a singular transform; the light is left out");
      return;
    }
    lights_.emplace_back(world[3]);
    light.direction = Vec3(glm::normalize(direction));
    scene_.lights.push_back(std::move(light));
  }

  void addMesh(uint32_t index) {
    const Node& node = document_.nodes[index];
    std::vector<glm::dmat4> placed;
    if (!firstMesh_) firstMesh_ = index;
    if (node.skin != kNone) {
      placed.emplace_back(1);
    } else {
      budget(2 * instanceCount(document_, node) * sizeof(glm::dmat4));
      for (const glm::dmat4& local : instanceTransforms(document_, node)) {
        const glm::dmat4 toWorld = pose_.world[index] * local;
        if (shapeOf(toWorld) != Shape::Gone && isFiniteMatrix(Mat4(toWorld))) {
          placed.emplace_back(toWorld);
        } else {
          document_.report.warn(nodePlace(index),
                                "a mesh that its transform makes a line or a point (a scale of 0) is left out");
        }
      }
    }
    const Mesh& mesh = document_.meshes[node.mesh];
    for (size_t p = 0; !placed.empty() && p < mesh.primitives.size(); ++p) {
      const std::string suffix = mesh.primitives.size() > 1 ? "/" + std::to_string(p) : "";
      const uint32_t job = jobFor(mesh.primitives[p], node, pose_.weights[index], mesh.name + suffix);
      budget(placed.size() * sizeof(MeshInstance));
      for (const glm::dmat4& toWorld : placed) {
        scene_.instances.push_back({job, Mat4(1)});
        transforms_.push_back(toWorld);
        // What is flattened cannot share its triangles.
        if (shapeOf(toWorld) == Shape::Flat) budget(estimatedBytes(document_, mesh.primitives[p]));
      }
    }
  }

  const Primitive* representative(const Primitive& primitive) {
    GeometryKey key{primitive.attributes,
                    primitive.targets,
                    primitive.indices,
                    primitive.material,
                    primitive.draco ? primitive.draco->view : kNone,
                    primitive.mode,
                    primitive.variantMaterials};
    return representatives_.emplace(std::move(key), &primitive).first->second;
  }

  uint32_t jobFor(const Primitive& primitive, const Node& node, const std::vector<float>& weights, std::string name) {
    const bool isMorphed = !primitive.targets.empty();
    MeshKey key{representative(primitive), node.skin, isMorphed ? weights : std::vector<float>()};
    const auto [entry, isNew] = jobIndex_.emplace(std::move(key), static_cast<uint32_t>(jobs_.size()));
    if (!isNew) return entry->second;
    budget(estimatedBytes(document_, primitive));
    MeshJob job;
    job.primitive = &primitive;
    job.name = std::move(name);
    job.material = materials_.use(materialOf(primitive));
    job.uvs = materials_.uvs(job.material);
    job.needsTangents = scene_.materials[job.material].needsTangents();
    job.keepAllAttributes = options_.keepAllAttributes;
    job.weights = entry->first.weights;
    if (node.skin != kNone) job.joints = jointsOf(node.skin);
    jobs_.push_back(std::move(job));
    return entry->second;
  }

  uint32_t materialOf(const Primitive& primitive) const {
    for (const auto& [variant, material] : primitive.variantMaterials) {
      if (variant == variant_) return material;
    }
    return primitive.material;
  }

  std::shared_ptr<const std::vector<glm::dmat4>> jointsOf(uint32_t skin) {
    if (!skins_[skin]) {
      skins_[skin] =
          std::make_shared<const std::vector<glm::dmat4>>(jointMatrices(document_, pose_, document_.skins[skin]));
    }
    return skins_[skin];
  }

  // A few bytes of JSON can ask for the same data over and over; real files stay far below this.
  void budget(uint64_t bytes) {
    constexpr uint64_t kAlways = uint64_t(1) << 30, kTimesSource = 64;
    spent_ += bytes;
    if (spent_ <= kAlways + kTimesSource * document_.sourceBytes()) return;
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
    if (firstMesh_) {
      uint32_t node = *firstMesh_;
      while (document_.nodes[node].parent != kNone) node = document_.nodes[node].parent;
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
  uint32_t variant_ = kNone;
  uint64_t spent_ = 0;
  std::optional<uint32_t> firstMesh_;             // the first node that shows one
  std::vector<glm::dmat4> transforms_, cameras_;  // of scene_.instances and scene_.cameras
  std::vector<glm::dvec3> lights_;                // positions of scene_.lights
  std::vector<size_t> jobOf_;                     // of scene_.meshes
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
