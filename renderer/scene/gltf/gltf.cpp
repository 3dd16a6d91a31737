// SPDX-License-Identifier: Apache-2.0
// Entry of the loader: read, check, build, and give the scene what its file lacks.
#include "renderer/scene/data/gltf.h"

#include <algorithm>
#include <set>

#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/gltf_material.h"
#include "renderer/scene/gltf/gltf_nodes.h"
#include "renderer/scene/gltf/poses/gltf_pose.h"
#include "renderer/scene/data/closed_mesh.h"
#include "renderer/scene/data/scene_defaults.h"

namespace braid {

namespace {

using namespace gltf;

void addDefaults(SceneData& scene, const LoadOptions& options, Report& report) {
  if (scene.instances.empty()) report.warn("", "there are no triangles to draw");
  if (scene.cameras.empty()) {
    scene.cameras.push_back(framingCamera(scene));
    scene.defaultCamera = true;
    report.warn("", "the file has no camera; one is added that frames what is to be seen");
  }
  if (options.defaultLight != DefaultLight::None && !hasLight(scene)) {
    const bool dark = !scene.lights.empty() || std::any_of(scene.materials.begin(), scene.materials.end(),
                                                           [](const Material& m) { return m.emissive(); });
    giveDefaultLight(scene, options.defaultLight);
    report.warn("", std::string(dark ? "the lights of the file emit nothing" : "the file has no light") + "; " +
                        describeDefaultLight(options.defaultLight));
  }
}

// Light that enters a solid must find its front outward; a walk ends at its surface, so that there must be one all
// around.
void checkSolids(SceneData& scene, Report& report) {
  if (turnSolidsOutward(scene) > 0)
    report.problem("/meshes", "a closed mesh with a volume (KHR_materials_volume) looks inward; turn its faces",
                   "they are turned outward");
  for (const TriangleMesh& mesh : scene.meshes)
    if (scene.materials[mesh.material].scatters() && !isClosedOutward(mesh))
      report.warn("",
                  "a mesh whose material scatters light within (KHR_materials_volume_scatter) is not closed by "
                  "itself, front faces outward; where nothing closes it, what scatters fills the scene's bounds");
}

SceneData describe(const Document& document) {
  SceneData scene;
  scene.file = document.path;
  scene.environment = document.environment;
  scene.extensionsUsed = document.model.extensionsUsed;
  scene.extensionsRequired = document.model.extensionsRequired;
  scene.extensionsIgnored = document.extensionsIgnored;
  scene.variants = document.variants;
  for (const tinygltf::Scene& source : document.model.scenes) scene.sceneNames.push_back(source.name);
  for (const tinygltf::Animation& a : document.model.animations)
    scene.animations.push_back({a.name, clipSeconds(document, a)});
  return scene;
}

}  // namespace

struct SceneFile::Opened {
  Document document;
  LogSink log;
  std::set<std::string> told;
  // What poses change, as the file has it.
  std::vector<tinygltf::Node> nodes;
  std::vector<Material> materials;
  std::vector<CameraData> cameras;
  std::vector<PunctualLight> lights;
  FilePartCounts parts{};
  Report report;
  Usage usage;
  ContentHash hash;

  void restore() {
    document.model.nodes = nodes;
    if (!document.properties.empty()) {
      document.materials = materials;
      document.cameras = cameras;
      document.lights = lights;
    }
    document.parts = parts;
    document.report = report;
    document.usage = usage;
    document.hash = hash;
  }
  void tell(const std::vector<std::string>& warnings) {
    for (const std::string& line : warnings)
      if (log && told.insert(line).second) log(LogLevel::Warning, document.path + ": " + line);
  }
};

SceneFile::SceneFile(const std::string& path, const LoadOptions& options, const LogSink& log)
    : opened_(std::make_unique<Opened>()) {
  Document& document = opened_->document;
  document.options = options;
  readDocument(document, path);
  resolveViews(document);
  readMaterials(document);
  readCamerasAndLights(document);
  resolvePointers(document);
  validate(document);
  readImageBasedLight(document);
  opened_->log = log;
  opened_->nodes = document.model.nodes;
  opened_->materials = document.materials;
  opened_->cameras = document.cameras;
  opened_->lights = document.lights;
  opened_->parts = document.parts;
  opened_->report = document.report;
  opened_->usage = document.usage;
  opened_->hash = document.hash;
}

SceneFile::~SceneFile() = default;

SceneData SceneFile::pose(std::optional<float> frameTime) {
  opened_->restore();
  Document& document = opened_->document;
  document.options.frameTime = frameTime;
  const LoadOptions& options = document.options;
  SceneData scene = describe(document);
  animateProperties(document);
  MaterialTable materials(document, scene, options.doubleSided);
  buildScene(document, options, materials, scene);
  materials.loadTextures();
  checkSolids(scene, document.report);
  if (options.strict) document.report.throwIfBroken(document.path);
  // A file that never had a surface is no flaw; one that lost them all has nothing to show.
  if (scene.instances.empty()) {
    document.report.throwIfBroken(document.path, &document.usage);
    document.report.throwIfBroken(document.path);
  }
  scene.parts = document.parts;
  addDefaults(scene, options, document.report);
  scene.contentHash = document.hash.value();
  scene.warnings = document.report.lines(document.usage, true);
  scene.notes = document.report.lines(document.usage, false);
  opened_->tell(scene.warnings);
  return scene;
}

SceneData loadGltf(const std::string& path, const LoadOptions& options, const LogSink& log) {
  return SceneFile(path, options, log).pose(options.frameTime);
}

}  // namespace braid
