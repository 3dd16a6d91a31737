// SPDX-License-Identifier: Apache-2.0
// Light that no integrator of a plan can find is told, and no error is estimated for images that lack it.
#include <doctest/doctest.h>

#include "tests/support/command_line.h"
#include "tests/support/render_fixture.h"

namespace braid::test_light_out_of_reach {

using namespace test;

namespace {

// A floor in the sun under glass: a slab that refracts, or a thin pane.
SceneData underGlass(bool solid) {
  SceneData data;
  Material glass = diffuseMaterial(Spectrum(1));
  glass.specular = 1;
  glass.roughness = 0;
  glass.transmission = 1;
  glass.thinWalled = !solid;
  data.materials = {diffuseMaterial(Spectrum(0.7f)), glass};
  TriangleMesh floor, slab;
  addQuad(floor, {-1, 0, 1}, {2, 0, 0}, {0, 0, -2});
  addQuad(slab, {-9, 2.5f, -9}, {0, 0, 18}, {18, 0, 0});
  if (solid) addQuad(slab, {-9, 2.3f, -9}, {18, 0, 0}, {0, 0, 18});
  addMesh(data, std::move(floor), 0);
  addMesh(data, std::move(slab), 1);
  PunctualLight sun;
  sun.kind = PunctualKind::Directional;
  sun.direction = {0, -1, 0};
  data.lights.push_back(sun);
  data.cameras.push_back(cameraAt({0, 1.1f, 1.5f}, {0, 0, 0}));
  return data;
}

}  // namespace

TEST_CASE("A plan whose integrators cannot find the light says so") {
  const Scene hidden(underGlass(true)), open(underGlass(false));
  const auto unreachable = [](const Scene& scene, std::vector<std::string> names) {
    Settings s = settingsFor(64, 48, 1);
    s.integrators = std::move(names);
    const Plan plan = makePlan(scene, scene.data().cameras[0], s, integrators());
    CHECK((plan.text().find("light out of reach") != std::string::npos) == !plan.unreachable.empty());
    return plan.unreachable;
  };
  for (const char* blind : {"pt", "crn", "gdpt"}) {
    const std::string text = unreachable(hidden, {blind});
    CAPTURE(text);
    CHECK(text.find("100 % of the light in view") != std::string::npos);
    CHECK(text.find(blind) != std::string::npos);
    CHECK(text.find("--integrator auto") != std::string::npos);
    CHECK(unreachable(open, {blind}).empty());
  }
  CHECK(unreachable(hidden, {"auto"}).empty());
  CHECK(unreachable(hidden, {"bdpt"}).empty());  // the camera is under the glass, too
  CHECK(unreachable(hidden, {"pt", "sppm"}).empty());
  CHECK(unreachable(hidden, {"vcm"}).empty());
}

TEST_CASE("Connections cannot find what both light and camera see through glass alone") {
  SceneData data = underGlass(true);
  data.cameras[0] = cameraAt({0, 4, 1.5f}, {0, 0, 0});
  const Scene scene(std::move(data));
  Settings s = settingsFor(64, 48, 1);
  for (const auto& [name, blind] : {std::pair("bdpt", true), {"sppm", false}, {"vcm", false}, {"auto", false}}) {
    CAPTURE(std::string(name));
    s.integrators = {name};
    CHECK(makePlan(scene, scene.data().cameras[0], s, integrators()).unreachable.empty() == !blind);
  }
}

TEST_CASE("A render that cannot find its light warns at both ends, estimates no error and never stops by it") {
  // A floor under a slab of refracting glass, in the sun.
  GltfFile file = quadFile();
  file.primitive()["material"] = file.append("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 0}}}});
  Json slab = file.root["meshes"][0];
  slab["primitives"][0]["material"] =
      file.append("materials", {{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0}}},
                                {"extensions",
                                 {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                                  {"KHR_materials_volume", {{"thicknessFactor", 0.1}}}}}});
  file.append("meshes", slab);
  file.root["extensions"] = {{"KHR_lights_punctual", {{"lights", {{{"type", "directional"}, {"intensity", 3}}}}}}};
  file.root["cameras"] = {
      {{"type", "orthographic"}, {"orthographic", {{"xmag", 0.3}, {"ymag", 0.3}, {"znear", 0.01}, {"zfar", 9}}}}};
  file.root["nodes"] = {{{"mesh", 0}},
                        {{"mesh", 1}, {"translation", {-9, -9, 1.2}}, {"scale", {20, 20, 1}}},
                        {{"mesh", 1}, {"translation", {-9, 9, 1}}, {"scale", {20, 20, 1}}, {"rotation", {1, 0, 0, 0}}},
                        {{"camera", 0}, {"translation", {0.5, 0.5, 0.9}}},
                        {{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}}};
  file.root["scenes"] = {{{"nodes", {0, 1, 2, 3, 4}}}};
  file.root["extensionsUsed"] = {"KHR_materials_transmission", "KHR_materials_volume", "KHR_lights_punctual"};
  const Folder folder;
  folder.write("scene.glb", file.glb());
  const std::string render = "render scene.glb -o o.exr --size 16x16 --no-default-light --combine none ";
  const auto warnings = [](const Run& run) {
    size_t count = 0;
    for (size_t at = 0; (at = run.err.find("warning: 100 % of the light in view", at)) != std::string::npos; ++at)
      ++count;
    return count;
  };

  const Run blind = braidRun(folder, render + "--spp 4 --log-json log --integrator pt");
  CHECK(blind.code == 0);
  CHECK(warnings(blind) == 2);
  CHECK(contains(blind.err, "the error of this image is not known"));
  CHECK(!contains(blind.err, "estimated error"));
  const std::string log = readText(folder.path / "log");
  CHECK(contains(log, "\"estimatedError\":null"));
  CHECK(!contains(log, "\"estimatedError\":0"));
  CHECK(braidRun(folder, render + "--spp 4 --error 0.1 --integrator pt").code == 6);
  const Run endless = braidRun(folder, render + "--error 0.1 --integrator pt");
  CHECK(endless.code == 1);
  CHECK(contains(endless.err, "--integrator auto"));
  const Run seeing = braidRun(folder, render + "--spp 4 --integrator auto");
  CHECK(seeing.code == 0);
  CHECK(warnings(seeing) == 0);
  CHECK(contains(seeing.err, "estimated error"));
}

}  // namespace braid::test_light_out_of_reach
