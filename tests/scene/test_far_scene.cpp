// SPDX-License-Identifier: Apache-2.0
// Scenes that lie far from the zero of their file's coordinates, as models in map and earth-centred coordinates do.
#include <doctest/doctest.h>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tests/support/gltf_fixture.h"
#include "tests/support/statistics/pass_means.h"

namespace braid::test_far_scene {

using namespace test;

namespace {

using Point = std::array<double, 3>;
const Point kEarth{3133805.225747891, 5447439.535584584, -992857.7233499398};

void addCameraAndLight(GltfFile& file, const Json& cameraAt, const Json& lightAt) {
  file.root["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.01}}}}};
  file.root["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}, {"intensity", 20}}};
  file.root["extensionsUsed"] = {"KHR_lights_punctual"};
  file.root["nodes"].push_back({{"camera", 0}, {"translation", cameraAt}});
  file.root["nodes"].push_back({{"translation", lightAt}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
}

// A pyramid on a square, lit from beside, under a root node that carries everything away.
GltfFile pyramid(const Point& at) {
  GltfFile file;
  const int position = file.accessor<float>(
      {-0.9f, -0.8f, -0.7f, 0.9f, -0.8f, -0.7f, 0.9f, 0.7f, -0.7f, -0.9f, 0.7f, -0.7f, 0.1f, 0.05f, 0.3f}, "VEC3");
  const int indices = file.accessor<uint16_t>({0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4, 0, 2, 1, 0, 3, 2}, "SCALAR");
  file.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", position}}}, {"indices", indices}}}}}};
  file.root["nodes"] = {{{"translation", at}, {"children", {1, 2, 3}}}, {{"mesh", 0}}};
  addCameraAndLight(file, {0.2, 0.1, 4}, {1.5, 1, 2});
  file.root["nodes"][1]["rotation"] = {0.1, 0.2, 0.05, 0.9};
  return file;
}

RenderResult picture(const SceneData& data, const char* integrator = "pt") {
  return render(data, settingsOf(integrator, 32, 32, 8));
}

double relativeError(const RenderResult& a, const RenderResult& b) {
  double error = 0, total = 0;
  for (size_t i = 0; i < a.image.size(); ++i) {
    const glm::dvec3 x(a.image.pixel(i)), y(b.image.pixel(i));
    error += glm::dot(x - y, x - y);
    total += glm::dot(y, y);
  }
  REQUIRE(total > 0);
  return error / total;
}

}  // namespace

TEST_CASE("A model that its root node carries to earth-centred coordinates is the one at home, to the bit") {
  const SceneData home = pyramid({0, 0, 0}).load(), away = pyramid(kEarth).load();
  CHECK(home.origin == glm::dvec3(0));
  CHECK(away.origin == glm::dvec3(kEarth[0], kEarth[1], kEarth[2]));
  for (const char* integrator : {"pt", "bdpt", "sppm"})
    CHECK(sameBits(estimateOf(picture(home, integrator)), estimateOf(picture(away, integrator))));
}

TEST_CASE("Every node placed by itself, and instances, far away") {
  const auto flat = [](const Point& at) {
    GltfFile file = pyramid({0, 0, 0});
    const auto add = [&](Json& node, const Point& local) {
      node["translation"] = {at[0] + local[0], at[1] + local[1], at[2] + local[2]};
    };
    file.root["nodes"].erase(0);
    file.root["scenes"][0]["nodes"] = {0, 1, 2, 3};
    add(file.root["nodes"][0], {0, 0, 0});
    add(file.root["nodes"][1], {0.2, 0.1, 4});
    add(file.root["nodes"][2], {1.5, 1, 2});
    const int places = file.accessor<float>({0.5f, 0, 0, -0.5f, 0.25f, 0}, "VEC3");
    file.root["nodes"].push_back(
        {{"mesh", 0}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}}});
    add(file.root["nodes"][3], {0.1, 0.2, -1});
    file.root["extensionsUsed"].push_back("EXT_mesh_gpu_instancing");
    return file.load();
  };
  CHECK(relativeError(picture(flat(kEarth)), picture(flat({0, 0, 0}))) < 1e-6);
}

TEST_CASE("Vertices themselves far away, as floats that can say where they are") {
  // Multiples of 64: exact as floats at 6,000 km.
  const auto square = [](double x, bool byVertices) {
    GltfFile file;
    const auto v = static_cast<float>(byVertices ? x : 0);
    const int position =
        file.accessor<float>({v - 128, -64, 0, v + 128, -64, 0, v + 128, 128, -64, v - 128, 128, -64}, "VEC3");
    const int indices = file.accessor<uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR");
    file.root["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", position}}}, {"indices", indices}}}}}};
    file.root["nodes"] = {{{"mesh", 0}}};
    file.root["scenes"][0]["nodes"] = {0, 1, 2};
    addCameraAndLight(file, {x + 3.25, 7.5, 400}, {x + 100, 90.125, 200});
    file.root["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = 1e5;
    if (!byVertices) file.root["nodes"][0]["translation"] = {x, 0, 0};
    return file.load();
  };
  const RenderResult home = picture(square(0, true));
  CHECK(relativeError(picture(square(6.4e6, true)), home) < 1e-6);
  CHECK(relativeError(picture(square(6.4e6, false)), home) < 1e-6);
  CHECK(square(6.4e6, true).origin.x == 6.4e6);
}

TEST_CASE("Skinned meshes far away") {
  const auto skinned = [](const Point& at) {
    GltfFile file = pyramid(at);
    const int joints = file.accessor<uint8_t>({0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, "VEC4");
    const int weights =
        file.accessor<float>({0.5f, 0.5f, 0, 0, 1, 0, 0, 0, 0.25f, 0.75f, 0, 0, 0.5f, 0.5f, 0, 0, 1, 0, 0, 0}, "VEC4");
    file.primitive()["attributes"]["JOINTS_0"] = joints;
    file.primitive()["attributes"]["WEIGHTS_0"] = weights;
    file.root["nodes"][1].erase("rotation");
    file.root["nodes"][1]["skin"] = 0;
    file.root["nodes"].push_back({{"translation", {0.125, 0.25, 0}}});
    file.root["nodes"].push_back({{"translation", {-0.125, 0, 0.25}}});
    file.root["nodes"][0]["children"] = {1, 2, 3, 4, 5};
    file.root["skins"] = {{{"joints", {4, 5}}}};
    return file.load();
  };
  CHECK(relativeError(picture(skinned(kEarth)), picture(skinned({0, 0, 0}))) < 1e-6);
}

TEST_CASE("Scenes within 64 of their radii keep the coordinates of their file") {
  CHECK(pyramid({60, 0, 0}).load().origin == glm::dvec3(0));
  CHECK(pyramid({200, 0, 0}).load().origin == glm::dvec3(200, 0, 0));
}

TEST_CASE("The command line speaks the file's coordinates wherever the scene lies") {
  const Folder folder;
  folder.write("far.glb", pyramid(kEarth).glb());
  folder.write("home.glb", pyramid({0, 0, 0}).glb());
  const auto bounds = [&](const std::string& name) {
    const Run run = braidRun(folder, "info " + name + " --json");
    REQUIRE(run.code == 0);
    return Json::parse(run.out)["bounds"];
  };
  const Json here = bounds("home.glb"), there = bounds("far.glb");
  for (size_t c = 0; c < 3; ++c)
    for (const char* end : {"min", "max"})
      CHECK(there[end][c].get<double>() - kEarth[c] == doctest::Approx(here[end][c].get<double>()).epsilon(1e-5));

  const auto render = [&](const std::string& name, const Point& at) {
    const std::string view =
        fmt::format(" --look-at {},{},{},{},{},{}", at[0] + 1.5, at[1] + 2, at[2] + 3, at[0], at[1], at[2]);
    const Run run = braidRun(folder, "render " + name + view + " -q --size 24x24 --spp 4 -o " + name + ".exr");
    INFO(run.err);
    REQUIRE(run.code == 0);
    const Run path = braidRun(folder, "replay " + name + view + " --size 24x24 --pixel 12,12");
    const size_t at2 = path.out.find("ray from (");
    REQUIRE(at2 != std::string::npos);
    double x = 0;
    REQUIRE(std::sscanf(path.out.c_str() + at2, "ray from (%lf", &x) == 1);
    CHECK(x == doctest::Approx(at[0] + 1.5).epsilon(1e-12));
    return readImage(folder.path / (name + ".exr"));
  };
  const ImageFile a = render("far.glb", kEarth), b = render("home.glb", {0, 0, 0});
  double difference = 0;
  for (const char* c : {"R", "G", "B"})
    for (size_t i = 0; i < a.planes.at(c).size(); ++i)
      difference = std::max(difference, std::abs(static_cast<double>(a.planes.at(c).data[i] - b.planes.at(c).data[i])));
  CHECK(difference < 1e-3);
}

}  // namespace braid::test_far_scene
