// SPDX-License-Identifier: Apache-2.0
// Renders a scene through the library and checks what comes back. Exit code 0: all is well.
#include <cstdio>
#include <string>

#include <braid/braid.h>

namespace {

int failures = 0;

void check(bool ok, const char* what) {
  if (ok) return;
  std::fprintf(stderr, "failed: %s\n", what);
  ++failures;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto scene = braid::load(argv[1]);
  braid::Settings settings;
  settings.width = settings.height = 32;
  settings.spp = 4;
  const braid::RenderPlan plan = braid::plan(*scene, settings);
  check(!plan.plan.text().empty(), "the plan has a text");

  int calls = 0;
  const braid::Rendering full = braid::render(*scene, plan, [&](const braid::Progress& p) {
    ++calls;
    return p.rounds == 4;
  });
  check(calls == 4 && full.rounds == 4, "progress is reported every round");
  for (const char* name : {"R", "G", "B", "Albedo.R", "N.Z", "Depth.Z", "pt.mean.R", "pt.halfA.G", "pt.variance.B"})
    check(full.planes.count(name) == 1 && full.planes.at(name).size() == 32 * 32, name);
  check(full.planes.count("A") == 0, "no alpha unless asked for");
  double sum = 0;
  for (const float v : full.planes.at("pt.mean.R").data) sum += static_cast<double>(v);
  check(sum > 0, "the image is not black");

  const braid::Combination combined = braid::combine(*full.estimates);
  check(combined.planes.at("R").size() == 32 * 32 && combined.planes.count("Error.Y") == 1, "auto combines a render");

  const braid::Rendering some = braid::render(*scene, plan, [](const braid::Progress& p) { return p.round < 2; });
  check(some.rounds == 2 && some.reason == braid::StopReason::Cancelled, "progress can end the render");

  try {
    braid::load("no such file.glb");
    check(false, "a missing file is an exception");
  } catch (const braid::Error& e) {
    check(e.code() == braid::ExitCode::BadInput, "a missing file is bad input");
    check(std::string(e.what()).find("no such file.glb") != std::string::npos, "the error names the file");
  }
  settings.integrators = {"nonsense"};
  try {
    braid::plan(*scene, settings);
    check(false, "an unknown integrator is an exception");
  } catch (const braid::Error& e) {
    check(e.code() == braid::ExitCode::Usage, "an unknown integrator is wrong usage");
  }
  return failures == 0 ? 0 : 1;
}
