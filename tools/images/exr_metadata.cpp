// SPDX-License-Identifier: Apache-2.0
#include "tools/images/exr_metadata.h"

#include <fmt/format.h>

#include "renderer/core/hash.h"
#include "renderer/session/integrator.h"
#include "renderer/session/pixel_filter.h"
#include "renderer/session/rendering_revision.h"
#include "tools/images/estimates_file.h"
#include "version.h"

namespace braid {

namespace {

Attribute text(const std::string& name, const std::string& value) {
  Attribute a;
  a.name = name;
  a.text = value;
  return a;
}

Attribute integer(const std::string& name, uint64_t value) {
  Attribute a;
  a.name = name;
  a.kind = Attribute::Kind::Int;
  a.integer = static_cast<int64_t>(value);
  return a;
}

Attribute number(const std::string& name, double value) {
  Attribute a;
  a.name = name;
  a.kind = Attribute::Kind::Float;
  a.number = value;
  return a;
}

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
      text("Software", std::string("braid ") + BRAID_VERSION),
      text("braid/version", BRAID_VERSION),
      integer("braid/renderingRevision", static_cast<uint64_t>(kRenderingRevision)),
      text("braid/build", BRAID_BUILD_FLAGS),
      text("braid/isa", isa),
      text("braid/scene", scene.data().file),
      text("braid/sceneHash", hexString(scene.data().contentHash)),
      integer("braid/warnings", scene.data().warnings.size()),
      text("braid/plan", plan.text()),
      text("braid/planHash", hexString(plan.hash())),
      text("braid/seed", std::to_string(s.seed)),
      text("braid/sampler", s.sampler == SamplerKind::Sobol ? "sobol" : "independent"),
      text("braid/filter", toString(s.filter)),
      integer("braid/maxDepth", static_cast<uint64_t>(s.maxDepth)),
      text("braid/varianceIs", varianceIs(plan)),
      matrix("worldToCamera", plan.camera.worldToCamera(scene.data().origin)),
      matrix("worldToNDC", plan.camera.worldToNdc(scene.data().origin)),
  };
  if (s.clamp > 0) list.push_back(number("braid/clamp", static_cast<double>(s.clamp)));
  if (!plan.unreachable.empty()) list.push_back(text(kUnreachableAttribute, plan.unreachable));
  return list;
}

std::vector<Attribute> passAttributes(const Estimates& estimates, double seconds, bool timing) {
  uint64_t rejected = 0;
  for (const Estimate& e : estimates.estimates) rejected += e.rejected;
  std::vector<Attribute> list{integer("samplesPerPixel", estimates.estimates.front().passes),
                              integer("braid/rejectedSamples", rejected)};
  for (Attribute& a : estimateAttributes(estimates, timing))
    if (a.name != "braid/seed") list.push_back(std::move(a));
  if (timing) list.push_back(number("renderTimeSeconds", seconds));
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
