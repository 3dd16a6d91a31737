// SPDX-License-Identifier: Apache-2.0
// Entry of the loader: read, check, build, and give the scene what its file lacks.
#include "renderer/scene/gltf.h"

#include <algorithm>

#include "renderer/scene/gltf_document.h"
#include "renderer/scene/gltf_material.h"
#include "renderer/scene/gltf_nodes.h"
#include "renderer/scene/gltf_pose.h"
#include "renderer/scene/scene_defaults.h"

namespace braid {

namespace {

using namespace gltf;

void checkAsset(const JsonRef& asset) {
  const std::string version =
      asset.required("write {\"version\": \"2.0\"}")["version"].required("write \"2.0\"").text("2.0");
  if (!version.starts_with("2.")) asset["version"].problem("is " + quoted(version) + "; convert the file to glTF 2.0");
  const std::string minimum = asset["minVersion"].text("2.0");
  if (minimum != "2.0")
    asset["minVersion"].problem("is " + quoted(minimum) + "; only glTF 2.0 can be read: convert the file");
}

// Everything that can be wrong is found before anything is built.
void readDocument(Document& document, const std::string& path) {
  readContainer(document, path);
  const JsonRef root(document.root.get(), "", &document.report);
  if (!root.isObject()) document.report.throwIfBroken(path);
  checkExtensions(document, root);
  checkAsset(root["asset"]);
  parseData(document, root);
  parseMaterials(document, root);
  parseMeshes(document, root);
  parseCamerasAndLights(document, root);
  parseNodes(document, root);
  parseAnimations(document, root);
  readBuffers(document);
  resolveViews(document);
  validate(document);
  document.report.throwIfBroken(path);
}

void addDefaults(SceneData& scene, const LoadOptions& options, Report& report) {
  if (scene.instances.empty()) report.warn("", "there are no triangles to draw");
  if (scene.cameras.empty()) {
    scene.cameras.push_back(framingCamera(scene));
    scene.defaultCamera = true;
    report.warn("", "the file has no camera; one is added that sees the whole scene");
  }
  if (options.defaultLight && !hasLight(scene)) {
    const bool dark = !scene.lights.empty() || std::any_of(scene.materials.begin(), scene.materials.end(),
                                                           [](const Material& m) { return m.emissive(); });
    scene.environment = EnvironmentData{nullptr, Spectrum(kDefaultDome), 0};
    scene.defaultLight = true;
    report.warn("", std::string(dark ? "the lights of the file emit nothing" : "the file has no light") +
                        "; a grey dome of radiance 0.5 is added (--no-default-light: none)");
  }
}

SceneData describe(const Document& document) {
  SceneData scene;
  scene.file = document.path;
  scene.extensionsUsed = document.extensionsUsed;
  scene.extensionsRequired = document.extensionsRequired;
  scene.extensionsIgnored = document.extensionsIgnored;
  scene.variants = document.variants;
  for (const SceneSource& source : document.scenes) scene.sceneNames.push_back(source.name);
  for (const Animation& a : document.animations) scene.animations.push_back({a.name, clipSeconds(document, a)});
  return scene;
}

}  // namespace

SceneData loadGltf(const std::string& path, const LoadOptions& options, const LogSink& log) {
  Document document;
  document.allowExternal = options.allowExternal;
  readDocument(document, path);
  SceneData scene = describe(document);
  MaterialTable materials(document, scene, options.doubleSided);
  buildScene(document, options, materials, scene);
  materials.loadTextures();
  document.report.throwIfBroken(path);
  addDefaults(scene, options, document.report);
  scene.contentHash = document.hash.value();
  scene.warnings = document.report.warningLines();
  if (log) {
    for (const std::string& line : scene.warnings) log(LogLevel::Warning, path + ": " + line);
  }
  return scene;
}

}  // namespace braid
