// SPDX-License-Identifier: Apache-2.0
#include "tools/python/run.h"

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "tools/images/exr_metadata.h"
#include "tools/prepare/scene_identity.h"
#include "version.h"

namespace braid::python {

Run::Run(std::shared_ptr<const SceneHolder> scene, const Words& words)
    : scene_(std::move(scene)), choice_(renderChoice(words)), integrators_(makeIntegrators()) {
  const Settings settings = makeSettings(scene_->choice, choice_.samples);
  planned_ = planRender(*scene_->opened.scene, scene_->opened.camera, settings, pointersTo(integrators_),
                        choice_.combine, {settings.spp});
  requireWithinLimit(planned_.memory);
}

void Run::begin(uint64_t spp, double seconds) {
  Plan plan = planned_.plan;
  plan.settings.spp = spp;
  plan.settings.seconds = seconds;
  const Scene& scene = *scene_->opened.scene;
  auto session = std::make_unique<Session>(scene, plan);
  session->identify(BRAID_VERSION, BRAID_BUILD_FLAGS, sceneIdentity(scene_->choice, scene.data()),
                    planAttributes(scene, plan, scene.accel().isa()));
  if (session_) session->resume(session_->release(), "the render");
  session_ = std::move(session);
}

void Run::advance(const Session::ProgressCallback& progress) {
  begin(planned_.plan.settings.spp, planned_.plan.settings.seconds);
  report_ = session_->advance(progress);
  made_.reset();
}

void Run::resume(uint64_t spp, double seconds, const Session::ProgressCallback& progress) {
  if (spp == 0 && seconds <= 0) throw Error(ExitCode::Usage, "resume: give spp, the samples in all, or seconds");
  if (spp > 0 && spp < report_.spp)
    throw Error(ExitCode::Usage, "resume: there are " + std::to_string(report_.spp) + " samples already: give more");
  begin(spp, seconds);
  report_ = session_->advance(progress);
  made_.reset();
}

Estimates Run::estimates() const { return describedEstimates(*session_, true); }

std::shared_ptr<const Made> Run::made() {
  if (!made_) made_ = made(choice_.combine);
  return made_;
}

std::shared_ptr<const Made> Run::made(const CombineChoice& choice) {
  return std::make_shared<const Made>(estimates(), session_->alpha(), choice, threads());
}

}  // namespace braid::python
