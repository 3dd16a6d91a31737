// SPDX-License-Identifier: Apache-2.0
// Sweeps that take a second, and how they fail.
#pragma once

#include <functional>
#include <sstream>
#include <string>
#include <utility>

#include "renderer/core/error.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/render_fixture.h"
#include "tools/sweep/sweep.h"

namespace braid::test::small_sweeps {

// 24x24 pixels of the Cornell box, independent samples, one thread's worth of work.
inline SweepOptions smallSweep(const Folder& folder) {
  SweepOptions o;
  o.scenes = {test::sourcePath("scenes/cornell.glb")};
  o.output = (folder.path / "sweep").string();
  o.methods = {"pt"};
  o.spp = parseLadder("4:16", false);
  o.seeds = 2;
  o.referenceSpp = 64;
  o.view.size = {24, 24};
  o.sampler = SamplerKind::Independent;
  o.maxDepth = 5;
  o.noPlots = true;
  o.view.quiet = true;
  return o;
}

inline std::pair<ExitCode, std::string> failureOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& e) {
    return {e.code(), e.what()};
  }
  return {ExitCode::Ok, ""};
}

inline int sweep(const SweepOptions& o) {
  std::ostringstream out;
  return runSweep(o, out);
}

}  // namespace braid::test::small_sweeps
