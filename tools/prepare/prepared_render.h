// SPDX-License-Identifier: Apache-2.0
// Scene, plan and session of every command that renders or plans a render.
#pragma once

#include <memory>
#include <vector>

#include "renderer/session/session.h"
#include "tools/options/open_scene.h"
#include "tools/prepare/planned_render.h"

namespace braid {

struct PreparedRender {
  OpenedScene opened;
  std::vector<std::unique_ptr<Integrator>> integrators;  // the plan points to some of them
  PlannedRender planned;

  const Scene& scene() const { return *opened.scene; }
};

// Opens the scene and plans. Where combining by default is left out, `combine` names no methods afterwards.
PreparedRender prepareRender(const SceneChoice& scene, const Settings& settings, CombineChoice& combine,
                             const RenderExtent& extent);

// The same of a scene that is open already.
PreparedRender prepareRender(OpenedScene opened, const Settings& settings, CombineChoice& combine,
                             const RenderExtent& extent);

// A session whose states and images say what they are of. Throws Error(OutOfMemory) where the plan needs too much.
std::unique_ptr<Session> beginSession(const PreparedRender& render, const SceneChoice& scene);

}  // namespace braid
