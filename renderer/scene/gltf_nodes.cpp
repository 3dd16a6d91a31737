// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf_nodes.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/parallel.h"

namespace braid::gltf {

namespace {

std::string nodePlace(uint32_t node) { return "/nodes/" + std::to_string(node); }

// Inverting must not lose the shape: volume compared with the cube of the longest axis.
bool isInvertible(const glm::dmat4& m) {
  const glm::dmat3 linear(m);
  const double longest = std::max({glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2])});
  const double volume = std::abs(glm::determinant(linear));
  return std::isfinite(longest) && longest > 1e-18 && longest < 1e18 && volume > 1e-18 * longest * longest * longest;
}

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
    const glm::dvec3 back(world[2]), up(world[1]);
    const glm::dvec3 side = glm::cross(up, back);
    if (!(glm::length(side) > 1e-30) || !isFiniteMatrix(Mat4(world))) {
      document_.report.warn(nodePlace(index), "a camera's node has a singular transform; the camera is left out");
      return;
    }
    const glm::dvec3 z = glm::normalize(back), x = glm::normalize(side);
    camera.toWorld = Mat4(glm::dmat4(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0), world[3]));
    scene_.cameras.push_back(std::move(camera));
  }

  void addLight(uint32_t index) {
    const Node& node = document_.nodes[index];
    if (node.light == kNone) return;
    PunctualLight light = document_.lights[node.light];
    if (!node.name.empty()) light.name = node.name;
    const glm::dmat4& world = pose_.world[index];
    const glm::dvec3 direction = -glm::dvec3(world[2]);
    if (!(glm::length(direction) > 1e-30) || !isFiniteMatrix(Mat4(world))) {
      document_.report.warn(nodePlace(index), "a light's node has a singular transform; the light is left out");
      return;
    }
    light.position = Vec3(world[3]);
    light.direction = Vec3(glm::normalize(direction));
    scene_.lights.push_back(std::move(light));
  }

  void addMesh(uint32_t index) {
    const Node& node = document_.nodes[index];
    std::vector<Mat4> placed;
    if (node.skin != kNone) {
      placed.emplace_back(1);
    } else {
      budget(instanceCount(document_, node) * sizeof(glm::dmat4));
      for (const glm::dmat4& local : instanceTransforms(document_, node)) {
        const glm::dmat4 toWorld = pose_.world[index] * local;
        if (isInvertible(toWorld) && isFiniteMatrix(Mat4(toWorld))) {
          placed.emplace_back(toWorld);
        } else {
          document_.report.warn(nodePlace(index),
                                "a mesh with a transform that cannot be inverted (a scale of 0) is left out");
        }
      }
    }
    const Mesh& mesh = document_.meshes[node.mesh];
    for (size_t p = 0; !placed.empty() && p < mesh.primitives.size(); ++p) {
      const std::string suffix = mesh.primitives.size() > 1 ? "/" + std::to_string(p) : "";
      const uint32_t job = jobFor(mesh.primitives[p], node, pose_.weights[index], mesh.name + suffix);
      budget(placed.size() * sizeof(MeshInstance));
      for (const Mat4& toWorld : placed) scene_.instances.push_back({job, toWorld});
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

  std::shared_ptr<const std::vector<glm::mat4>> jointsOf(uint32_t skin) {
    if (!skins_[skin]) {
      skins_[skin] =
          std::make_shared<const std::vector<glm::mat4>>(jointMatrices(document_, pose_, document_.skins[skin]));
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
    }
    std::erase_if(scene_.instances, [&](MeshInstance& instance) {
      instance.mesh = placed[instance.mesh];
      return instance.mesh == kNone;
    });
  }

  Document& document_;
  const LoadOptions& options_;
  MaterialTable& materials_;
  SceneData& scene_;
  Pose pose_;
  uint32_t variant_ = kNone;
  uint64_t spent_ = 0;
  std::vector<std::shared_ptr<const std::vector<glm::mat4>>> skins_;
  std::map<GeometryKey, const Primitive*> representatives_;
  std::map<MeshKey, uint32_t> jobIndex_;
  std::vector<MeshJob> jobs_;
};

}  // namespace

void buildScene(Document& document, const LoadOptions& options, MaterialTable& materials, SceneData& scene) {
  SceneBuilder(document, options, materials, scene).build();
}

}  // namespace braid::gltf
