// SPDX-License-Identifier: Apache-2.0
// braid as a library: load a scene, plan a render, run it, combine what it estimated, get named planes.
//
// Errors are braid::Error exceptions (SceneError for scene files). Nothing is printed, nothing is global, and the
// process is never ended. A Scene may be rendered by several threads at once.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "combiners/pipeline/pipeline.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/scene/data/gltf.h"
#include "renderer/scene/scene.h"
#include "renderer/session/integrator.h"
#include "renderer/session/session.h"

namespace braid {

// Reads a glTF file and builds everything that rays need. Warnings go to `log` and to scene->data().warnings.
// Where the file's lights leave what its first camera sees dark, light is added (LoadOptions::defaultLight).
std::unique_ptr<Scene> load(const std::string& path, const LoadOptions& options = {},
                            const SceneOptions& sceneOptions = {}, const LogSink& log = {});

// A plan and the integrators that it names.
struct RenderPlan {
  std::shared_ptr<const std::vector<std::unique_ptr<Integrator>>> integrators;
  Plan plan;
};

// What a render of the scene will do; plan.text() says what is left out and why. Without a camera: the first one of the
// file, which every loaded scene has.
RenderPlan plan(const Scene& scene, const Settings& settings);
RenderPlan plan(const Scene& scene, const Settings& settings, const CameraData& camera);

// Has the render keep what combine() will read for this method besides means, halves and variances. Without it most
// methods still run, with less to go by.
void keepFor(const std::string& method, RenderPlan& plan);

struct Rendering : RenderResult {
  // Every plane by its channel name in braid's EXR files: "R", "Albedo.G", "N.X", "pt.mean.R", "pt.variance.B", …
  std::map<std::string, Plane<float>> planes;
};

// Runs the plan; `progress` is called after each round of passes and ends the render by returning false, which keeps
// what is done. writeExr(path, *r.estimates, r.image, …) saves the result.
Rendering render(const Scene& scene, const RenderPlan& plan, const Session::ProgressCallback& progress = {});

// The method, what it read, its image with halves, its estimated error, seconds.
struct Combination : PipelineOutput {
  // By channel name: "R", "G", "B"; "Error.Y", the estimated squared error, where the method knows it.
  std::map<std::string, Plane<float>> planes;
};

// Denoises or combines the estimates by the method of a name as --combine has it: "auto", "nfor", "js@sppm"
// (combiners/README.md lists them). Throws Error(Usage) for unknown names, Error(BadInput) with the reason where the
// method cannot run on these estimates.
Combination combine(const Estimates& estimates, const std::string& method = "auto",
                    const PipelineOptions& options = {});

}  // namespace braid
