// SPDX-License-Identifier: Apache-2.0
// Options that turn and scale the light that a file brings, or replace it.
#include <doctest/doctest.h>

#include "renderer/scene/environment.h"
#include "tests/scene/gltf/gltf_lenient.h"
#include "tests/support/textures/cube_file.h"
#include "tools/options/open_scene.h"

namespace braid::test_light_options {

using namespace test;
using test::gltf_lenient::hasNote;

TEST_CASE("image-based light: --env goes first, and --env-scale, --env-rotate and --light-scale act on either") {
  using Bytes = std::vector<uint8_t>;
  GltfFile file = cubeFile(4, [](size_t face, int, int) {
    return face == 0 ? Bytes{255, 183, 134, 85} : Bytes{9, 9, 9, 255};
  });
  const Folder folder;
  const Bytes png = pngOf(8, 4, Bytes(96, 200));
  SceneChoice choice;
  choice.quiet = true;
  choice.file = folder.write("scene.glb", file.glb());
  choice.environmentScale = 3;
  choice.lightScale = 2;
  choice.environmentRotation = 90;
  SceneData scene = loadScene(choice);
  CHECK(scene.environment->ofFile);
  CHECK(scene.environment->radiance == Spectrum(6));
  // Turned from +Z toward +X, as --env-rotate turns: what lay in +X lies in -Z.
  CHECK(Environment(*scene.environment).radiance({0, 0, -1}).x == doctest::Approx(18).epsilon(1e-4));
  choice.environment = folder.write("sky.png", std::string(png.begin(), png.end()));
  scene = loadScene(choice);
  CHECK_FALSE(scene.environment->ofFile);
  CHECK(scene.environment->image->width == 8);
  CHECK(hasNote(scene, "another environment is given"));
}

TEST_CASE("Where nothing is to be seen nothing is rendered, but for environments and moments without surfaces") {
  GltfFile file = triangleFile();
  file.root["nodes"] = {{{"name", "empty"}}};
  const Folder folder;
  SceneChoice choice;
  choice.quiet = true;
  choice.size = {8, 6};
  choice.file = folder.write("scene.glb", file.glb());
  CHECK_THROWS_WITH_AS(openScene(choice), doctest::Contains("scene.glb: there is nothing to render"), Error);
  choice.frameTime = 0;
  CHECK(openScene(choice).scene->data().instances.empty());
  choice.frameTime = -1;
  const std::vector<uint8_t> png = pngOf(8, 4, std::vector<uint8_t>(96, 200));
  choice.environment = folder.write("sky.png", std::string(png.begin(), png.end()));
  CHECK(openScene(choice).scene->environment().has_value());
}

}  // namespace braid::test_light_options
