// SPDX-License-Identifier: Apache-2.0
// Entry of the loader: read, check, build, and give the scene what its file lacks.
#include "renderer/scene/data/gltf.h"

#include <algorithm>

#include "renderer/scene/gltf/document/gltf_document.h"
#include "renderer/scene/gltf/gltf_material.h"
#include "renderer/scene/gltf/gltf_nodes.h"
#include "renderer/scene/gltf/gltf_pose.h"
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

SceneData describe(const Document& document) {
  SceneData scene;
  scene.file = document.path;
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

SceneData loadGltf(const std::string& path, const LoadOptions& options, const LogSink& log) {
  Document document;
  document.options = options;
  readDocument(document, path);
  resolveViews(document);
  readMaterials(document);
  readCamerasAndLights(document);
  validate(document);
  SceneData scene = describe(document);
  MaterialTable materials(document, scene, options.doubleSided);
  buildScene(document, options, materials, scene);
  materials.loadTextures();
  if (options.strict) document.report.throwIfBroken(path);
  // A file that never had a surface is no flaw; one that lost them all has nothing to show.
  if (scene.instances.empty()) {
    document.report.throwIfBroken(path, &document.usage);
    document.report.throwIfBroken(path);
  }
  addDefaults(scene, options, document.report);
  scene.contentHash = document.hash.value();
  scene.warnings = document.report.lines(document.usage, true);
  scene.notes = document.report.lines(document.usage, false);
  if (log) {
    for (const std::string& line : scene.warnings) log(LogLevel::Warning, path + ": " + line);
  }
  return scene;
}

}  // namespace braid
