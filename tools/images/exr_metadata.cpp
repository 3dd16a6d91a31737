// SPDX-License-Identifier: Apache-2.0
#include "tools/images/exr_metadata.h"

#include <fmt/format.h>

#include "renderer/core/hash.h"
#include "renderer/film/make_attribute.h"
#include "renderer/session/integrator.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/session/rendering_revision.h"
#include "tools/images/estimates_file.h"
#include "version.h"

namespace braid {

namespace {

Attribute matrix(const std::string& name, const Mat4& m) {
  Attribute a;
  a.name = name;
  a.kind = Attribute::Kind::Matrix;
  // OpenEXR multiplies row vectors from the left, so its rows are our columns.
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) a.values.push_back(m[i][j]);
  return a;
}

// What the variance planes of the plan's integrators are.
std::string varianceIs(const Plan& plan) {
  std::string rescaled;
  for (const PlannedIntegrator& p : plan.integrators)
    if (p.integrator->lowDiscrepancy(plan.settings))
      rescaled += (rescaled.empty() ? "" : ", ") + std::string(p.integrator->name());
  return rescaled.empty() ? "variance of the mean"
                          : "variance of the mean; of " + rescaled + " rescaled from independent buckets";
}

}  // namespace

std::vector<Attribute> planAttributes(const Scene& scene, const Plan& plan, const std::string& isa) {
  const Settings& s = plan.settings;
  std::vector<Attribute> list{
      textAttribute("Software", std::string("braid ") + BRAID_VERSION),
      textAttribute("braid/version", BRAID_VERSION),
      wholeAttribute("braid/renderingRevision", kRenderingRevision),
      textAttribute("braid/build", BRAID_BUILD_FLAGS),
      textAttribute("braid/isa", isa),
      textAttribute("braid/scene", scene.data().file),
      textAttribute("braid/sceneHash", hexString(scene.data().contentHash)),
      wholeAttribute("braid/warnings", scene.data().warnings.size()),
      textAttribute("braid/plan", plan.text()),
      textAttribute("braid/planHash", hexString(plan.hash())),
      textAttribute("braid/seed", std::to_string(s.seed)),
      textAttribute("braid/sampler", s.sampler == SamplerKind::Sobol ? "sobol" : "independent"),
      textAttribute("braid/filter", toString(s.filter)),
      wholeAttribute("braid/maxDepth", s.maxDepth),
      textAttribute("braid/varianceIs", varianceIs(plan)),
      matrix("worldToCamera", plan.camera.worldToCamera(scene.data().origin)),
      matrix("worldToNDC", plan.camera.worldToNdc(scene.data().origin)),
  };
  const SceneData& data = scene.data();
  if (data.defaultLight) list.push_back(textAttribute("braid/defaultLight", data.backdrop ? "studio" : "dome"));
  if (data.defaultCamera) list.push_back(textAttribute("braid/defaultCamera", "framed"));
  if (data.motion.seconds > 0) list.push_back(numberAttribute("braid/shutter", data.motion.seconds));
  if (plan.camera.lensRadius() > 0) {
    list.push_back(numberAttribute("braid/lensDiameter", 2 * static_cast<double>(plan.camera.lensRadius())));
    list.push_back(numberAttribute("focus", static_cast<double>(plan.camera.focusDistance())));
  }
  if (s.clamp > 0) list.push_back(numberAttribute("braid/clamp", static_cast<double>(s.clamp)));
  if (!plan.unreachable.empty()) list.push_back(textAttribute(kUnreachableAttribute, plan.unreachable));
  return list;
}

std::vector<Attribute> passAttributes(const Estimates& estimates, double seconds, bool timing) {
  uint64_t rejected = 0;
  for (const Estimate& e : estimates.estimates) rejected += e.rejected;
  std::vector<Attribute> list{wholeAttribute("samplesPerPixel", estimates.estimates.front().passes),
                              wholeAttribute("braid/rejectedSamples", rejected)};
  for (Attribute& a : estimateAttributes(estimates, timing))
    if (a.name != "braid/seed") list.push_back(std::move(a));
  if (timing) list.push_back(numberAttribute("renderTimeSeconds", seconds));
  return list;
}

Estimates describedEstimates(const FilmState& state, bool quarters, bool timing) {
  Estimates e = estimatesOf(state, quarters);
  e.attributes = state.attributes;
  for (Attribute& a : passAttributes(e, state.seconds, timing)) e.attributes.push_back(std::move(a));
  return e;
}

Estimates describedEstimates(const Session& session, bool timing) {
  return describedEstimates(session.state(), session.plan().settings.keep.quarters, timing);
}

std::vector<Attribute> headerAttributes(const Scene& scene, const Session& session, const RenderResult& result,
                                        const std::string& isa, bool timing) {
  std::vector<Attribute> list = planAttributes(scene, session.plan(), isa);
  for (Attribute& a : passAttributes(*result.estimates, result.seconds, timing)) list.push_back(std::move(a));
  return list;
}

}  // namespace braid
