// SPDX-License-Identifier: Apache-2.0
// Without the module that runs networks everything else works, and what needs it is left out with a sentence.
#include <doctest/doctest.h>

#include "tests/support/running_braid.h"

namespace braid::test_convolution_module {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Run;
namespace fs = std::filesystem;

TEST_CASE("Without the module of convolutions oidn is left out in one line") {
  const Folder folder;
  fs::create_directories(folder.path / "bin");
  fs::create_directories(folder.path / "weights");
  fs::copy_file(BRAID_BINARY, folder.path / "bin/braid");
  const auto plan = [&](const std::string& weights) {
    return braidRun(folder, "--version >/dev/null; { bin/braid plan '" BRAID_SOURCE_DIR
                            "/scenes/cornell.glb' --denoiser oidn --oidn-weights " +
                                weights + "; }");
  };
  const Run absent = plan("weights");
  CHECK(absent.code == 0);
  CHECK(contains(absent.out, "- oidn: "));
  CHECK(contains(absent.out, "braid_onednn.so, which runs networks, does not exist"));
  const Run nowhere = plan("no-such-folder");
  CHECK(nowhere.code == 0);
  CHECK(contains(nowhere.out, "- oidn: no-such-folder: there is no such folder of weights"));
  folder.write("bin/braid_onednn.so", "no library");
  CHECK(contains(plan("weights").out, "braid_onednn.so, which runs networks, cannot be opened: "));
}

}  // namespace braid::test_convolution_module
