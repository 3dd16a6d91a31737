// SPDX-License-Identifier: Apache-2.0
// The command line starts without the libraries that images need, and says what is wrong where it cannot open them.
#include <doctest/doctest.h>

#include "tests/support/running_braid.h"

#ifdef BRAID_IMAGE_MODULE

namespace braid::test_image_module {

using test::braidRun;
using test::contains;
using test::Folder;
using test::readText;
using test::Run;
namespace fs = std::filesystem;

namespace {

const std::string kScenes = BRAID_SOURCE_DIR "/scenes/";
const std::string kRender = "render '" + kScenes + "cornell.glb' -q --size 8x8 --spp 1 --integrator pt --combine none ";

// The program alone, in bin/.
void copyProgram(const Folder& folder) {
  fs::create_directory(folder.path / "bin");
  fs::copy_file(BRAID_BINARY, folder.path / "bin/braid");
}

Run runCopy(const Folder& folder, const std::string& arguments) {
  return braidRun(folder, "--version >/dev/null; { bin/braid " + arguments + "; }");
}

void checkRefused(const Run& run) {
  CHECK(run.code == 3);
  CHECK(contains(run.err, "bin/braid_images.so: reads and writes images, and cannot be opened: "));
  CHECK(contains(run.err, "install braid again"));
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
}

}  // namespace

TEST_CASE("Nothing that images need is linked to the program") {
  const Folder folder;
  const Run run = braidRun(folder, "", "LD_TRACE_LOADED_OBJECTS=1 ");
  CHECK(contains(run.out, "libembree"));
  CHECK_FALSE(contains(run.out, "OpenImageIO"));
  CHECK(std::count(run.out.begin(), run.out.end(), '\n') < 40);
}

TEST_CASE("Without the image module only what needs it fails") {
  const Folder folder;
  copyProgram(folder);
  CHECK(runCopy(folder, "--version").code == 0);
  CHECK(runCopy(folder, "plan '" + kScenes + "cornell.glb'").code == 0);
  const Run render = runCopy(folder, kRender + "-o out.exr --log-json log");
  CHECK(render.code == 3);
  CHECK(contains(render.err, "lib"));
  CHECK(contains(render.err, "braid_images.so: reads and writes images, and cannot be opened: there is no such file"));
  CHECK_FALSE(fs::exists(folder.path / "out.exr"));
  CHECK_FALSE(contains(readText(folder.path / "log"), "\"end\""));
  CHECK(runCopy(folder, kRender + "--checkpoint out.state").code == 0);  // no image at all
  // Textures are not left out in silence.
  CHECK(runCopy(folder, "info '" + kScenes + "door_ajar.glb'").code == 3);
}

TEST_CASE("An image module that is damaged is refused in one line, a whole one beside the program is opened") {
  const Folder folder;
  copyProgram(folder);
  folder.write("bin/braid_images.so", "no library");
  checkRefused(runCopy(folder, kRender + "-o out.exr"));
  fs::copy_file(BRAID_IMAGE_MODULE, folder.path / "bin/braid_images.so", fs::copy_options::overwrite_existing);
  CHECK(runCopy(folder, kRender + "-o out.exr").code == 0);
  CHECK(fs::exists(folder.path / "out.exr"));
}

}  // namespace braid::test_image_module

#endif
